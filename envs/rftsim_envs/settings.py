"""Settings as people give them: each field of a frozen dataclass gets the type that it is declared with."""

import math
import os
from collections.abc import Iterable
from typing import Any, Literal, get_args, get_origin, get_type_hints


def convert_fields(settings: object, error: type[Exception]) -> None:
    """Turn every field of a frozen dataclass into its declared type, in place; numbers may come as text.

    Raises:
        error: The value of a field cannot be had as its type.
    """
    for name, kind in get_type_hints(type(settings)).items():
        value = getattr(settings, name)
        try:
            object.__setattr__(settings, name, parsed(kind, value))
        except (TypeError, ValueError):
            raise error(f"{name} must be {_wanted(kind)}, not {value!r}") from None


def check_positive(settings: object, names: Iterable[str], error: type[Exception]) -> None:
    """Raise an error for the first of these settings that is not a positive number."""
    for name in names:
        if not getattr(settings, name) > 0:
            raise error(f"{name} must be positive, not {getattr(settings, name):g}")


def parsed(kind: Any, value: Any) -> Any:
    """A value as a float, int, bool or str, as a tuple of one of these, or as one of a Literal's.

    Raises:
        ValueError: It cannot be had as this kind, or it is not finite.
        TypeError: It is neither text nor a number, or not a sequence of them.
    """
    if get_origin(kind) is Literal:
        return _one_of(get_args(kind), value)
    if get_origin(kind) is tuple:
        first, *others = get_args(kind)
        parts = value.split(",") if isinstance(value, str) else list(value)
        if value == "" and others == [...]:
            return ()
        if others != [...] and len(parts) != 1 + len(others):
            raise ValueError
        return tuple(parsed(first, part) for part in parts)
    if kind is bool:
        return _one_of(("false", "true"), str(value).lower()) == "true"
    if kind is str:
        if isinstance(value, os.PathLike):
            return os.fspath(value)
        if not isinstance(value, str):
            raise TypeError
        return value
    return _number(kind, value)


def _one_of(choices: tuple[Any, ...], value: Any) -> Any:
    if value not in choices:
        raise ValueError
    return value


def _number(kind: type[float] | type[int], value: Any) -> float:
    number = float(value)  # 2e6 is whole, too
    if isinstance(value, bool) or not math.isfinite(number) or number != kind(number):
        raise ValueError
    return kind(number)


def _wanted(kind: Any) -> str:
    """Name of a kind in an error."""
    if get_origin(kind) is Literal:
        return " or ".join(map(repr, get_args(kind)))
    if get_origin(kind) is tuple:
        named = {int: "whole numbers: 64,64", str: "names with commas between them"}
        return named.get(get_args(kind)[0], "numbers: low,high")
    return {float: "a finite number", int: "a whole number", bool: "true or false", str: "text"}[kind]
