"""Columns of a CSV file by name, read and checked."""

import functools
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rftsim.errors import RftsimError, RftsimNote
from rftsim.fit.spreadsheet import UNITS, has_decimal_commas, name_and_unit, read_sheet
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

    Entries may lie between commas, semicolons or tabs. Of names, capitals do not count, and a unit may follow, `Depth
    [m]`. Decimal commas are read where they cannot be anything else. Columns that are not read are told as a
    `RftsimNote`.

    Args:
        path: The file.
        needed: Columns of numbers that must be there.
        optional: Columns of numbers that may be.
        words: Columns of text that must be there.

    Raises:
        RftsimError: The file is missing or holds no rows, a column is missing, there twice or in another unit, a row is
            too long, or an entry is no finite number.
    """
    numbers = (*needed, *optional)
    sheet = read_sheet(path, (*words, *numbers))
    places = _places(path, sheet.headings, (*words, *numbers))
    for name in (*words, *needed):
        if name not in places:
            known = ", ".join(heading.strip() for heading in sheet.headings) or "none"
            raise RftsimError(f"{path} has no column {name!r}; it has {known}")
    at: list[int] = []
    cells: dict[str, list[str]] = {name: [] for name in places}
    for line, row in sheet.rows:
        if any(cell.strip() for cell in row[len(sheet.headings) :]):
            count = len(sheet.headings)
            raise RftsimError(f"{path}, line {line}, has {len(row)} entries under {count} headings")
        at.append(line)
        for name, place in places.items():
            cells[name].append(row[place].strip() if place < len(row) else "")
    if not at:
        raise RftsimError(f"{path} has no rows")
    there = [name for name in numbers if name in places]
    try:
        commas = has_decimal_commas(cell for name in there for cell in cells[name])
    except RftsimError as error:
        raise RftsimError(f"{path}: {error}") from None
    found = Columns({}, {name: cells[name] for name in words})
    for name in there:
        found.numbers[name] = _numbers(cells[name], commas, functools.partial(_place, path, at, name))
    unread = [heading.strip() for k, heading in enumerate(sheet.headings) if k not in places.values()]
    if any(unread):
        warnings.warn(f"{path}: not read: {', '.join(filter(None, unread))}", RftsimNote, stacklevel=2)
    return found


def _places(path: Path, headings: list[str], names: tuple[str, ...]) -> dict[str, int]:
    """Where each column is that is there."""
    found: dict[str, int] = {}
    known = [name_and_unit(heading) for heading in headings]
    for name in names:
        places = [k for k, (own, _) in enumerate(known) if own == name.lower()]
        if len(places) > 1:
            raise RftsimError(f"{path} has {len(places)} columns {name!r}; give each once")
        if places:
            unit, wanted = known[places[0]][1], UNITS.get(name, "")
            if unit and unit != wanted:
                remedy = f"give it in {wanted}" if wanted else "it has no unit"
                raise RftsimError(f"{path}: {name} is in [{unit}]; {remedy}")
            found[name] = places[0]
    return found


def _place(path: Path, lines: list[int], name: str, k: int) -> str:
    """The words for where an entry stands."""
    return f"{path}, line {lines[k]}, {name}"


def _numbers(cells: list[str], commas: bool, place: Callable[[int], str]) -> Array:
    """The numbers of a column, some of which may have decimal commas; `place` says where an entry stands."""
    texts = [cell.replace(",", ".") for cell in cells] if commas else cells
    try:
        found = np.array(list(map(float, texts)))
    except ValueError:
        k = next(k for k, text in enumerate(texts) if not _is_number(text))
        raise RftsimError(f"{place(k)}: {_shown(cells[k])} is no number") from None
    bad = np.flatnonzero(~np.isfinite(found))
    if len(bad):
        raise RftsimError(f"{place(int(bad[0]))}: {found[bad[0]]} is not finite")
    return found


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _shown(cell: str) -> str:
    """An entry as errors show it."""
    return repr(cell[:40]) + "..." * (len(cell) > 40) if cell else "nothing"
