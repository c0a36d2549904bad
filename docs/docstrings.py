"""Docstrings as the pages need them: tables in Markdown, bars of absolute values, colons in what fields say."""

import re
from typing import Any

from sphinx.application import Sphinx

FIELDS = ("attribute", "data", "property")
COLON = "\ua789"
"""Stands for a colon while napoleon reads a field's docstring, of which it would take what is before it for a type."""
ROW = re.compile(r"^\s*\|.*\|\s*$")
BAR = re.compile(r"(?<![\\`])\|")


def before(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Make of a docstring what napoleon reads as it is meant."""
    lines[:] = [line for part in _parts(lines) for line in part]
    if what in FIELDS:
        lines[:] = [line.replace(":", COLON) for line in lines]


def after(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Put the colons back."""
    lines[:] = [line.replace(COLON, ":") for line in lines]


def _parts(lines: list[str]) -> list[list[str]]:
    """The docstring with its tables as reStructuredText, and its bars escaped."""
    found: list[list[str]] = []
    rows: list[str] = []
    for line in [*lines, ""]:
        if ROW.match(line):
            rows.append(line)
            continue
        if rows:
            found.append(_table(rows))
            rows = []
        found.append([BAR.sub(r"\|", line)])
    return found


def _table(rows: list[str]) -> list[str]:
    """A table in Markdown as a list-table."""
    cells = [[cell.strip() for cell in row.strip().strip("|").split("|")] for row in rows]
    body = [row for row in cells if not all(set(cell) <= {"-", ":", " "} and cell for cell in row)]
    made = [".. list-table::", "   :header-rows: 1", ""]
    for row in body:
        made += [f"   {'* -' if k == 0 else '  -'} {cell}" for k, cell in enumerate(row)]
    return [*made, ""]


def setup(app: Sphinx) -> dict[str, bool]:
    """Look at each docstring before napoleon and after it."""
    app.connect("autodoc-process-docstring", before, priority=400)
    app.connect("autodoc-process-docstring", after, priority=600)
    return {"parallel_read_safe": True}
