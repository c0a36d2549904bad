"""The force laws by name, and what each needs of the sand and of the scene."""

from typing import Final, NamedTuple


class Law(NamedTuple):
    """A force law."""

    name: str
    planar: bool
    """Acts in one vertical plane of motion, on area vectors projected onto it."""
    dynamic: bool
    """Adds the inertial term, and behind wheels the structural one."""
    code: int
    """Which compiled loops evaluate it: 0 2D, 1 Table C.3, 2 Table C.4."""
    says: str


LAWS: Final = {
    law.name: law
    for law in (
        Law("rft2d", True, False, 0, "2D-RFT, [Agarwal] chapter 3"),
        Law("drft2d", True, True, 0, "2D Dynamic RFT, [Agarwal] chapter 4"),
        Law("rft3d", False, False, 1, "3D-RFT, [Agarwal] chapter 5, Table C.3"),
        Law("drft3d", False, True, 1, "3D-RFT with the dynamic terms of chapter 4; lambda_ is uncalibrated in 3D"),
        Law("rft3d:c4", False, False, 2, "3D-RFT with the fourth-degree Table C.4"),
        Law("drft3d:c4", False, True, 2, "3D Dynamic RFT with Table C.4; lambda_ is uncalibrated in 3D"),
    )
}
"""Every law by name."""


def get_law(name: "str | Law") -> Law:
    """A law by name.

    Raises:
        ValueError: No such law.
    """
    if isinstance(name, Law):
        return name
    if name not in LAWS:
        raise ValueError(f"no law {name!r}; laws are {', '.join(LAWS)}")
    return LAWS[name]
