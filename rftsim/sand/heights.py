"""Heights from files: greyscale pictures, arrays, and tables of numbers."""

import warnings
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from rftsim.errors import SandError
from rftsim.files import check_size
from rftsim.sand.terrain import MOST, Array, Terrain, lengths

PICTURES: Final = (".png",)
ARRAYS: Final = (".npy", ".npz", ".csv")
NAMES: Final = ("heights", "spacing", "origin", "repeat")
"""Arrays that are taken from an `.npz`."""
LARGEST: Final = 256_000_000
"""Largest file of numbers that is read [byte]."""
UNREADABLE: Final = (OSError, ValueError, KeyError, EOFError, SyntaxError)
"""Errors of the libraries that read files which are not what their ending says."""


def load_terrain(
    path: "str | Path",
    *,
    size: ArrayLike | None = None,
    spacing: ArrayLike | None = None,
    low: float = 0.0,
    high: float | None = None,
    centre: tuple[float, float] | None = None,
    repeat: bool = False,
) -> Terrain:
    """A terrain whose heights a file holds.

    A `.png` is a greyscale picture of 8 or 16 bits, seen from above: its upper edge is where y is greatest, as in
    MuJoCo's height fields. Arrays, `.npy` and `.npz`, and tables, `.csv`, hold metres, the first row where y is least.
    An `.npz` names them `heights`, and may name `spacing`, `origin` and `repeat`, those of `Terrain`.

    Args:
        path: The file.
        size: Distance from the first to the last value along x and along y [m]; one number stands for both.
        spacing: Distance between values [m] instead.
        low: Height of black [m].
        high: Height of white [m]; pictures need it.
        centre: Middle of the terrain, x and y [m]; by default the origin, or as an `.npz` says.
        repeat: Whether it repeats for ever.

    Raises:
        SandError: The file cannot be read, or what it lacks was not given.
        ValueError: What it holds are no heights of a terrain.
    """
    path = Path(path)
    found = _read(path, low, high)
    heights = found["heights"]
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise SandError(f"{path} must hold rows and columns of heights, not an array of shape {heights.shape}")
    parts = np.array(heights.shape[::-1]) - 1
    if (size is not None) + (spacing is not None) != 1 and not (size is None and "spacing" in found):
        raise SandError(f"give the size of {path} [m], from its first value to its last, or the spacing of its values")
    if size is not None or spacing is not None:
        found["spacing"] = lengths(spacing, "spacing") if size is None else lengths(size, "size") / parts
    if centre is not None or "origin" not in found:
        x, y = (0.0, 0.0) if centre is None else centre
        found["origin"] = np.array([x, y]) - lengths(found["spacing"], "spacing") * parts / 2
    return Terrain(heights, found["spacing"], found["origin"], repeat or bool(found.get("repeat", False)))


def _read(path: Path, low: float, high: float | None) -> dict[str, Any]:
    """What a file tells of a terrain by the names of `Terrain`, at least its heights [m]; other arguments as above."""
    kind = path.suffix.lower()
    if kind not in PICTURES + ARRAYS:
        raise SandError(f"no terrain is read from {path}: it must end in {', '.join(PICTURES)} or {', '.join(ARRAYS)}")
    if kind not in PICTURES and (high is not None or low != 0.0):
        raise SandError(f"{path} holds heights in metres: low and high are those of black and white in a picture")
    if not path.is_file():
        raise SandError(f"no terrain file {path}")
    if kind not in PICTURES:
        return _read_numbers(path, kind)
    if high is None:
        raise SandError(f"{path} is a picture: give high, the height of white [m], and low, that of black")
    return {"heights": low + (high - low) * _read_picture(path)}


def _read_picture(path: Path) -> Array:
    """The brightness of a greyscale picture, from 0 to 1, with its lowest row first, shape (rows, columns)."""
    from PIL import Image  # not at start-up, where few need it

    try:
        with Image.open(path, formats=["PNG"]) as picture:
            if picture.width * picture.height > MOST:
                raise SandError(f"{path} has more than the {MOST} values that a terrain may have: make it smaller")
            mode, pixels = picture.mode, np.asarray(picture if picture.mode != "1" else picture.convert("L"))
    except UNREADABLE as error:
        if isinstance(error, SandError):
            raise
        raise SandError(f"{path} cannot be read as a PNG picture: {error}") from None
    if mode not in ("1", "L") and not mode.startswith("I"):
        raise SandError(
            f"{path} is a picture in colours or with transparency ({mode}): save it in greyscale, 8 or 16 bits"
        )
    return pixels[::-1] / (65535.0 if mode.startswith("I") else 255.0)


def _read_numbers(path: Path, kind: str) -> dict[str, Any]:
    """The arrays of a file by name, at least its heights [m]."""
    check_size(path, LARGEST)
    names: list[str] = []
    try:
        if kind == ".csv":
            return {"heights": _read_table(path)}
        with open(path, "rb") as file:
            loaded = np.load(file, allow_pickle=False)
            if kind == ".npy":
                return {"heights": np.asarray(loaded, dtype=float)}
            names = list(loaded)
            arrays = {name: loaded[name] for name in NAMES if name in names}
            return arrays | {"heights": np.asarray(arrays["heights"], dtype=float)}
    except KeyError:
        raise SandError(f"{path} has no array 'heights'; it has {', '.join(names) or 'none'}") from None
    except UNREADABLE as error:
        raise SandError(f"{path} cannot be read as numbers: {' '.join(str(error).split())}") from None


def _read_table(path: Path) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a table without a row, which is refused
        return np.loadtxt(path, delimiter=",", ndmin=2, encoding="utf-8-sig")
