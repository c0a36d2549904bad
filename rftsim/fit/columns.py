"""Columns of a CSV file by name, read and checked."""

import csv
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rftsim.errors import RftsimError
from rftsim.surface.triangles import Array


class Columns(NamedTuple):
    """The columns of a table by name, those of numbers and those of text."""

    numbers: dict[str, Array]
    """Columns of numbers, shape (n,) each."""
    words: dict[str, list[str]]
    """Columns of text, n words each."""


def read_columns(path: Path, needed: tuple[str, ...], optional: tuple[str, ...] = ()) -> dict[str, Array]:
    """The columns of numbers of a CSV file by name, shape (n,) each; see `read_table`."""
    return read_table(path, needed, optional).numbers


def read_table(
    path: Path, needed: tuple[str, ...], optional: tuple[str, ...] = (), words: tuple[str, ...] = ()
) -> Columns:
    """The columns of a CSV by the names in its first line; lines that start with # are passed over.

    Args:
        path: The file.
        needed: Columns of numbers that must be there.
        optional: Columns of numbers that may be.
        words: Columns of text that must be there.

    Raises:
        RftsimError: The file is missing or holds no rows, a column is missing, or an entry is no finite number.
    """
    try:
        lines = path.read_text().splitlines()
    except OSError as error:
        raise RftsimError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise RftsimError(f"{path} is not text: {error}") from None
    numbered = [(i, line) for i, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    rows = list(csv.reader((line for _, line in numbered), skipinitialspace=True))
    names = [name.strip() for name in rows[0]] if rows else []
    for name in (*words, *needed):
        if name not in names:
            raise RftsimError(f"{path} has no column {name!r}; it has {', '.join(names) or 'none'}")
    if len(rows) < 2:
        raise RftsimError(f"{path} has no rows")
    found = Columns({}, {name: [row[names.index(name)].strip() for row in rows[1:]] for name in words})
    for name in (name for name in (*needed, *optional) if name in names):
        at = names.index(name)
        column = [
            _number(row, at, f"{path}, line {i}, {name}")
            for (i, _), row in zip(numbered, rows, strict=True)
            if i > numbered[0][0]
        ]
        found.numbers[name] = np.array(column)
    return found


def _number(row: list[str], at: int, where: str) -> float:
    try:
        value = float(row[at])
    except (ValueError, IndexError):
        raise RftsimError(f"{where}: {repr(row[at]) if at < len(row) else 'nothing'} is no number") from None
    if not math.isfinite(value):
        raise RftsimError(f"{where}: {value} is not finite")
    return value
