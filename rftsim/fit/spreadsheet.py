"""Text of a spreadsheet as programs write it: encodings, separators, decimal commas, and names with units."""

import csv
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

from rftsim.errors import RftsimError

LARGEST: Final = 100_000_000
"""Size of a file that is still read [byte]."""
SEPARATORS: Final = ",;\t"
"""The characters that may lie between entries."""
UNITS: Final = (
    {"depth": "m", "area": "m^2", "speed": "m/s"}
    | dict.fromkeys(("force", "force_x", "force_z", "normal", "tangential"), "N")
    | dict.fromkeys(("beta", "gamma", "psi"), "deg")
    | dict.fromkeys(("alpha_x", "alpha_y", "alpha_z"), "N/m^3")
)
"""Units of columns by name; those of others are part of their names, or they have none."""
_HEADING: Final = re.compile(r"([^\[(]+)(?:[\[(]([^\])]*)[\])])?\s*")
_SIGNS: Final = str.maketrans({"²": "^2", "³": "^3", "°": "deg"})
_COMMA: Final = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_GROUPED: Final = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")


class Sheet(NamedTuple):
    """The rows of a spreadsheet under its headings."""

    headings: list[str]
    """Headings as they stand in the first row."""
    rows: Iterator[tuple[int, list[str]]]
    """Every further row, with the number of the line at which it ends."""


def read_sheet(path: Path, wanted: Iterable[str]) -> Sheet:
    """The rows of a file; lines that are empty or start with # are passed over.

    Args:
        path: The file, with commas, semicolons or tabs between entries: whichever shows most of the wanted columns.
        wanted: Names of columns that are looked for.

    Raises:
        RftsimError: The file is missing, too large or no text; while rows are read: an entry that never ends.
    """
    numbered = [(i, line) for i, line in enumerate(_text(path).splitlines(), 1) if line.strip() and line[0] != "#"]
    if not numbered:
        return Sheet([], iter(()))
    names = set(wanted)

    def shown(separator: str) -> tuple[int, int]:
        headings = _row(path, numbered[0][1], separator)
        return len(names & {name_and_unit(heading)[0] for heading in headings}), len(headings)

    separator = max(SEPARATORS, key=shown)
    return Sheet(_row(path, numbered[0][1], separator), _rows(path, numbered, separator))


def _row(path: Path, line: str, separator: str) -> list[str]:
    return next(_rows(path, [(1, line), (1, line)], separator))[1]


def _rows(path: Path, numbered: list[tuple[int, str]], separator: str) -> Iterator[tuple[int, list[str]]]:
    """Rows below the first line."""
    lines = (line for _, line in numbered[1:])
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    try:
        for row in reader:
            yield numbered[reader.line_num][0], row
    except csv.Error as error:
        line = numbered[min(reader.line_num, len(numbered) - 1)][0]
        raise RftsimError(f"{path}, line {line}, is no row of entries: {error}") from None


def _text(path: Path) -> str:
    """The text of a file in UTF-8 or UTF-16 with its mark, or else in the code page of western Europe."""
    try:
        if path.stat().st_size > LARGEST:
            raise RftsimError(f"{path} has {path.stat().st_size / 1e6:.0f} MB; give at most {LARGEST / 1e6:.0f}")
        content = path.read_bytes()
    except OSError as error:
        raise RftsimError(f"cannot read {path}: {error.strerror}") from None
    if content.startswith(b"PK\3\4"):
        raise RftsimError(f"{path} is not text but a packed file; save the spreadsheet as CSV")
    try:
        if content.startswith((b"\xff\xfe", b"\xfe\xff")):
            return content.decode("utf-16")
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = content.decode("cp1252", errors="replace")
        if "\ufffd" in text:
            raise RftsimError(f"{path} is not text: {error}") from None
    if "\0" in text:
        raise RftsimError(f"{path} is not text: it has zero bytes")
    return text


def name_and_unit(heading: str) -> tuple[str, str]:
    """The name in a heading, in small letters, and its unit: `Depth [m]` has depth and m; no unit is empty."""
    found = _HEADING.fullmatch(heading.strip())
    if found is None:
        return heading.strip().lower(), ""
    unit = (found[2] or "").strip().translate(_SIGNS).replace("**", "^").removesuffix("rees").removesuffix("ree")
    return found[1].strip().lower(), re.sub(r"m([23])$", r"m^\1", "" if unit == "-" else unit)


def has_decimal_commas(cells: Iterable[str]) -> bool:
    """Whether the decimal mark of numbers is the comma.

    Raises:
        RftsimError: A comma, or a point beside it, may be decimal or not.
    """
    points, commas = "", ""
    decimal = False
    for cell in cells:
        if "," in cell:
            commas = commas or cell
            decimal = decimal or not _GROUPED.fullmatch(cell)
        elif "." in cell:
            points = points or cell
        if "," in cell and not _COMMA.fullmatch(cell):
            raise RftsimError(f"{cell[:40]!r} is no number; write decimal points, and no others")
    if commas and (points or not decimal):
        beside = f" beside {points[:40]!r}" if points else ""
        raise RftsimError(f"the comma of {commas[:40]!r}{beside} may be decimal or not; write decimal points")
    return bool(commas)
