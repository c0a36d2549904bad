"""The force laws by name, and what each needs of the sand and of the scene."""

from pathlib import Path
from typing import Final, NamedTuple

from rftsim.law.law_file import read_table
from rftsim.law.tables import TABLE_C3, TABLE_C4, Term


class Law(NamedTuple):
    """A force law."""

    name: str
    planar: bool
    """Acts in one vertical plane of motion, on area vectors projected onto it."""
    dynamic: bool
    """Adds the inertial term, and behind wheels the structural one."""
    code: int
    """Which compiled loops evaluate it: 0 2D, 1 a cubic table, 2 a quartic one."""
    says: str
    table: tuple[Term, ...] = ()
    """Powers and coefficients of f1, f2 and f3 of the 3D laws."""


LAWS: Final = {
    law.name: law
    for law in (
        Law("rft2d", True, False, 0, "2D-RFT, [Agarwal] chapter 3"),
        Law("drft2d", True, True, 0, "2D Dynamic RFT, [Agarwal] chapter 4"),
        Law("rft3d", False, False, 1, "3D-RFT, [Agarwal] chapter 5, Table C.3", TABLE_C3),
        Law(
            "drft3d",
            False,
            True,
            1,
            "3D-RFT with the dynamic terms of chapter 4; lambda_ is uncalibrated in 3D",
            TABLE_C3,
        ),
        Law("rft3d:c4", False, False, 2, "3D-RFT with the fourth-degree Table C.4", TABLE_C4),
        Law("drft3d:c4", False, True, 2, "3D Dynamic RFT with Table C.4; lambda_ is uncalibrated in 3D", TABLE_C4),
    )
}
"""Every law by name."""


def get_law(name: "str | Law") -> Law:
    """A law by name, or `rft3d:FILE.toml` and `drft3d:FILE.toml` with the table of a file.

    Raises:
        ValueError: No such law, or its file is missing or damaged.
    """
    if isinstance(name, Law):
        return name
    if name in LAWS:
        return LAWS[name]
    base, _, file = name.partition(":")
    if base in ("rft3d", "drft3d") and file.endswith(".toml"):
        return fitted_law(read_table(Path(file)), name)
    raise ValueError(f"no law {name!r}; laws are {', '.join(LAWS)}, and rft3d:FILE.toml of `rftsim fit map`")


def fitted_law(table: tuple[Term, ...], name: str = "rft3d") -> Law:
    """A 3D law with a table of one's own, in the order of Table C.3 or C.4; dynamic where its name says drft3d."""
    base = LAWS[name.partition(":")[0]]
    cubic = len(table) == len(TABLE_C3)
    says = f"{base.says.partition(',')[0]}, {'cubic' if cubic else 'quartic'} table of {name.partition(':')[2]}"
    return base._replace(name=name, code=1 if cubic else 2, says=says, table=table)
