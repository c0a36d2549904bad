"""The force laws: each one object, from which the compiled loops, the packed sand and the command line are made.

A law with another response, or one that reads a parameter more, is made here, of a stress of `stress`; nothing else
knows how many laws there are. docs/adding_a_law.md adds one.
"""

from pathlib import Path
from typing import Any, Final, NamedTuple

from rftsim.law import leading, stress
from rftsim.law.law_file import read_table
from rftsim.law.polynomials import cubic, quartic
from rftsim.law.tables import TABLE_C3, TABLE_C4, Term
from rftsim.machine.kernel import Kernel, kernel


@kernel
def own_depth(depth: Any, medium: Any) -> Any:
    """The depth that the stress grows with [m]: the triangle's own."""
    return depth


class Response(NamedTuple):
    """How sand answers the motion of one triangle, from which the compiled loops of a law are made."""

    reads: tuple[str, ...]
    """Parameters of the sand that it needs, beside those of the dynamic terms."""
    stress: Kernel
    """The stress on a triangle, see `stress.Stress`."""
    normal_speed: Kernel
    """The n.v that decides which triangles must be looked at, see `leading.may_lead`."""
    felt_depth: Kernel = own_depth
    """The depth that the stress grows with [m], from the triangle's own and the sand; zero or less: no stress."""

    @property
    def planar(self) -> bool:
        """Whether it acts in one vertical plane of motion, on area vectors projected onto it."""
        return self.normal_speed is leading.speed_in_plane


class Law(NamedTuple):
    """A force law: a response, whether it is dynamic, and its coefficients."""

    name: str
    response: Response
    dynamic: bool
    """Adds the inertial term, and behind wheels the structural one."""
    says: str
    table: tuple[Term, ...] = ()
    """Powers and coefficients of f1, f2 and f3 of the 3D laws."""

    @property
    def planar(self) -> bool:
        """Whether it acts in one vertical plane of motion, on area vectors projected onto it."""
        return self.response.planar

    @property
    def reads(self) -> tuple[str, ...]:
        """The parameters of the sand that it needs."""
        return self.response.reads + (("rho_c", "lambda_") if self.dynamic else ())


PLANE: Final = Response(("zeta",), stress.in_plane, leading.speed_in_plane)
CUBIC: Final = Response(("xi_n", "mu_surf"), stress.in_space(cubic), leading.speed_in_space)
QUARTIC: Final = CUBIC._replace(stress=stress.in_space(quartic))

LAWS: Final = {
    law.name: law
    for law in (
        Law("rft2d", PLANE, False, "2D-RFT, [Agarwal] chapter 3"),
        Law("drft2d", PLANE, True, "2D Dynamic RFT, [Agarwal] chapter 4"),
        Law("rft3d", CUBIC, False, "3D-RFT, [Agarwal] chapter 5, Table C.3", TABLE_C3),
        Law(
            "drft3d",
            CUBIC,
            True,
            "3D-RFT with the dynamic terms of chapter 4; lambda_ is uncalibrated in 3D",
            TABLE_C3,
        ),
        Law("rft3d:c4", QUARTIC, False, "3D-RFT with the fourth-degree Table C.4", TABLE_C4),
        Law("drft3d:c4", QUARTIC, True, "3D Dynamic RFT with Table C.4; lambda_ is uncalibrated in 3D", TABLE_C4),
    )
}
"""Every law by name."""

RESPONSES: Final = tuple(dict.fromkeys(law.response for law in LAWS.values()))
"""Every response; packed sand holds its law's by the place here, and the compiled loops choose by it."""


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
    response, degree = (CUBIC, "cubic") if len(table) == len(TABLE_C3) else (QUARTIC, "quartic")
    says = f"{base.says.partition(',')[0]}, {degree} table of {name.partition(':')[2]}"
    return base._replace(name=name, response=response, says=says, table=table)
