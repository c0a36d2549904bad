"""The sand's surface from whatever names it: a height, a slope, dunes, or a file of heights."""

import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from rftsim.errors import SandError
from rftsim.sand.dune_field import dunes
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.heights import ARRAYS, PICTURES, load_terrain
from rftsim.sand.terrain import Terrain

FILES: Final = PICTURES + ARRAYS
"""Endings of files of heights."""
RIGHT: Final = f"a height [m], slope=DEGREES, dunes, or a file that ends in {', '.join(FILES)}"
"""What texts name a surface."""


def make_terrain(terrain: "FreeSurface | Terrain | float | str") -> "FreeSurface | Terrain":
    """The sand's surface that a number or a text stands for.

    Texts are a height [m]; `slope=DEGREES`, which may go on with `,heading=DEGREES` (of the way up, from x towards y)
    and `,height=METRES` (at the origin); `dunes`, with the options of `dunes`; and the name of a file, with those of
    `load_terrain`. Options are `key=value`, and two lengths are `AxB`: `dunes,amplitude=0.05,seed=3`,
    `hill.png,size=8x6,high=0.5`.

    Args:
        terrain: A surface as it is, its height, or a text.

    Raises:
        SandError: It names no surface; the message says what would.
        ValueError: There is no such surface.
    """
    if isinstance(terrain, FreeSurface | Terrain):
        return terrain
    if isinstance(terrain, str):
        return _from_text(terrain)
    if isinstance(terrain, bool | np.bool_) or not isinstance(terrain, int | float | np.integer | np.floating):
        raise SandError(f"terrain must be a height, a FreeSurface, a Terrain or a text, not a {type(terrain).__name__}")
    return FreeSurface(height=float(terrain))


def _from_text(text: str) -> "FreeSurface | Terrain":
    words = [word.strip() for word in text.split(",")]
    first, rest = words[0], words[1:]
    if _is_number(first) and not rest:
        return FreeSurface(height=float(first))
    if first.startswith("slope="):
        return _slope(**_options(text, words, _slope))
    if first == "dunes":
        return dunes(**_options(text, rest, dunes))
    if first.lower().endswith(FILES):
        return load_terrain(first, **_options(text, rest, load_terrain))
    raise SandError(f"no terrain {text!r}: it must be {RIGHT}")


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _slope(slope: float, heading: float = 0.0, height: float = 0.0) -> FreeSurface:
    """A plane that rises by an angle [degrees] along a heading [degrees], with its height at the origin [m]."""
    if not abs(slope) < 90.0:
        raise SandError(f"a slope must be less than 90 degrees steep, not {slope:g}")
    rise, way = math.tan(math.radians(slope)), math.radians(heading)
    return FreeSurface(height, (-rise * math.cos(way), -rise * math.sin(way), 1.0))


def _options(text: str, words: list[str], maker: Callable[..., Any]) -> dict[str, Any]:
    """The options of a maker of surfaces from words `key=value`, each read as what the maker's own values are.

    Raises:
        SandError: A word is no option of it, or its value cannot be read.
    """
    known: Mapping[str, Any] = {
        name: one for name, one in inspect.signature(maker).parameters.items() if name not in ("path", "repose")
    }
    found: dict[str, Any] = {}
    for word in words:
        key, separator, value = (part.strip() for part in word.partition("="))
        if not separator or key not in known:
            raise SandError(
                f"{word!r} in the terrain {text!r} is no option; there are {', '.join(known)}, as key=value"
            )
        if key in found:
            raise SandError(f"{key!r} is given twice in the terrain {text!r}")
        found[key] = _value(key, value)
    return found


def _value(key: str, text: str) -> Any:
    """The value of an option: a number, two as AxB where they are lengths or a place, or yes or no."""
    if key == "repeat":
        if text not in ("yes", "no"):
            raise SandError(f"repeat is yes or no, not {text!r}")
        return text == "yes"
    parts = text.split("x") if key in ("size", "spacing", "centre") else [text]
    if not all(map(_is_number, parts)) or len(parts) > 2 or (key == "centre" and len(parts) != 2):
        two = {"centre": ", two as AxB"}.get(key, ", or two as AxB" if key in ("size", "spacing") else "")
        raise SandError(f"{key} must be a number{two}, not {text!r}")
    if key == "seed":
        if not text.isdigit():
            raise SandError(f"a seed is a whole number, zero or more, not {text!r}")
        return int(text)
    return float(parts[0]) if len(parts) == 1 else (float(parts[0]), float(parts[1]))
