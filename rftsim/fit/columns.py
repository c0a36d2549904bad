"""Columns of numbers from a CSV file."""

import csv
import math
from pathlib import Path

import numpy as np

from rftsim.errors import RftsimError
from rftsim.surface import Array


def read_columns(path: Path, needed: tuple[str, ...], optional: tuple[str, ...] = ()) -> dict[str, Array]:
    """Columns of a CSV by the names in its first line; lines that start with # are passed over.

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
    for name in needed:
        if name not in names:
            raise RftsimError(f"{path} has no column {name!r}; it has {', '.join(names) or 'none'}")
    if len(rows) < 2:
        raise RftsimError(f"{path} has no rows")
    found = {}
    for name in (name for name in (*needed, *optional) if name in names):
        at = names.index(name)
        column = [
            _number(row, at, f"{path}, line {i}, {name}")
            for (i, _), row in zip(numbered, rows, strict=True)
            if i > numbered[0][0]
        ]
        found[name] = np.array(column)
    return found


def _number(row: list[str], at: int, where: str) -> float:
    try:
        value = float(row[at])
    except (ValueError, IndexError):
        raise RftsimError(f"{where}: {repr(row[at]) if at < len(row) else 'nothing'} is no number") from None
    if not math.isfinite(value):
        raise RftsimError(f"{where}: {value} is not finite")
    return value
