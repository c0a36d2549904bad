"""A sand's parameters from trials of a plate: pushed down, dragged, slid."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from rftsim.errors import RftsimError
from rftsim.fit.columns import read_columns
from rftsim.fit.estimate import Estimate, estimate
from rftsim.fit.plates import at_unit_depth
from rftsim.law.rigid import surface_force
from rftsim.sand.medium import ALPHA_Z_PLATE, Sand
from rftsim.surface.triangles import Array

UNITS: Final = {"xi_n": "N/m^3", "zeta": "N/m^3", "K": "N/m", "lambda_": "-", "mu_surf": "-"}
"""Units of what trials estimate, by name."""


class Found(NamedTuple):
    """The parameters of a sand that a trial tells, and how well the trial fits them."""

    estimates: dict[str, Estimate]
    """Estimates by name, in the units of `UNITS`."""
    parameters: dict[str, float]
    """Parameters of `Sand` that follow, by name."""
    x: Array
    """The quantity that the fitted force is proportional to, or for a drag trial the speed, shape (n,)."""
    measured: Array
    """Force that was measured [N], shape (n,)."""
    fitted: Array
    """Force that the estimates give [N], shape (n,)."""
    labels: tuple[str, str]
    """Labels of x and of the force, with units."""
    doubts: list[str]
    """Sentences that say what is doubtful, with numbers."""


def pushed(path: Path, area: float | None) -> Found:
    """The xi_n of a flat plate pushed straight down, [Agarwal] eq. (5.21): F = 0.87574 xi_n A z.

    Args:
        path: CSV with columns depth [m] and force [N]; area [m^2] and test (a number) where there are several.
        area: Area of the plate [m^2], where there is no such column.
    """
    table = _read(path, ("depth", "force"), area)
    x, force, tests = table["area"] * table["depth"], table["force"], table.get("test")
    (slope,) = estimate(x[:, None], force, tests)
    _check(path, slope)
    doubts = []
    free = estimate(np.stack([x, np.ones_like(x)], axis=1), force, tests)
    if free[1].low * free[1].high > 0.0:
        doubts.append(
            f"the force is not proportional to depth: a line free to miss zero does by {free[1].value:.3g} N, and then "
            f"xi_n = {free[0].value / ALPHA_Z_PLATE:.4g} N/m^3"
        )
    xi_n = slope.over(ALPHA_Z_PLATE)
    return Found({"xi_n": xi_n}, {"xi_n": xi_n.value}, x, force, x * slope.value, ("A z [m^3]", "F [N]"), doubts)


def dragged(path: Path, area: float | None, rho_c: float) -> Found:
    """The K and lambda of an upright plate dragged level, [Agarwal] section 4.6: F = K z + lambda rho_c A v^2.

    Args:
        path: CSV with columns depth (of the plate's centre) [m], speed [m/s] and force (along the motion) [N]; area
            [m^2] and test where there are several.
        area: Area of the plate [m^2], where there is no such column.
        rho_c: Density of the sand [kg/m^3].
    """
    if not 0.0 < rho_c < math.inf:
        raise RftsimError(f"lambda is told by the sand's density: rho_c must be positive, not {rho_c:g} (--rho-c)")
    table = _read(path, ("depth", "speed", "force"), area)
    plate = table["area"]
    columns = np.stack([plate * table["depth"], rho_c * plate * table["speed"] ** 2], axis=1)
    if np.linalg.cond(columns / np.linalg.norm(columns, axis=0).clip(1e-300)) > 1e6:
        raise RftsimError(f"{path} cannot tell K from lambda: give two speeds or more at one depth")
    strength, lambda_ = estimate(columns, table["force"], table.get("test"))
    _check(path, strength)
    doubts = []
    if lambda_.low <= 0.0:
        doubts.append(f"lambda is not told from zero: {lambda_.low:.3g} to {lambda_.high:.3g}; go faster")
    sides = {law: _upright(law) for law in ("rft3d", "rft2d")}
    found = {"lambda_": lambda_, "xi_n": strength.over(sides["rft3d"]), "zeta": strength.over(sides["rft2d"])}
    if np.ptp(plate) == 0.0:
        found = {"K": strength.over(1.0 / plate[0]), **found}
    parameters = {"rho_c": rho_c, **{name: found[name].value for name in ("xi_n", "zeta", "lambda_")}}
    fitted = columns @ np.array([strength.value, lambda_.value])
    return Found(found, parameters, table["speed"], table["force"], fitted, ("v [m/s]", "F [N]"), doubts)


def slid(path: Path) -> Found:
    """The mu_surf of a plate that slides through sand: tangential over normal force, the cap of [Agarwal] eq. (5.6).

    Args:
        path: CSV with columns normal and tangential [N], or force_x, force_z [N] and beta [deg], the tilt of the plate,
            whose normal is (sin beta, 0, -cos beta); and test.
    """
    try:
        table = read_columns(path, ("normal", "tangential"), ("test",))
    except RftsimError as error:
        if "no column" not in str(error):
            raise
        table = read_columns(path, ("force_x", "force_z", "beta"), ("test",))
        s, c = np.sin(np.radians(table["beta"])), np.cos(np.radians(table["beta"]))
        table["normal"] = s * table["force_x"] - c * table["force_z"]
        table["tangential"] = c * table["force_x"] + s * table["force_z"]
    normal, tangential = np.abs(table["normal"]), np.abs(table["tangential"])
    (mu_surf,) = estimate(normal[:, None], tangential, table.get("test"))
    doubts = ["this is mu_surf only if the sand slides on the plate; where it sticks, the ratio is smaller"]
    return Found(
        {"mu_surf": mu_surf},
        {"mu_surf": mu_surf.value},
        normal,
        tangential,
        normal * mu_surf.value,
        ("normal force [N]", "tangential force [N]"),
        doubts,
    )


def _read(path: Path, needed: tuple[str, ...], area: float | None) -> dict[str, Array]:
    """Columns of a test, with the plate's area in each row."""
    if area is not None and not 0.0 < area < math.inf:
        raise RftsimError(f"area must be positive, not {area:g}")
    table = read_columns(path, needed if area is not None else (*needed, "area"), ("test",))
    table.setdefault("area", np.full(len(table["force"]), area))
    for name in ("area", "depth"):
        if not (table[name] >= 0.0).all():
            raise RftsimError(f"{path}: {name} must be positive (depth: down), not {table[name].min():g}")
    return table


def _check(path: Path, slope: Estimate) -> None:
    if not slope.value > 0.0:
        raise RftsimError(
            f"{path}: the force must grow with depth, not fall by {-slope.value:.3g} N/m^3: check its sign"
        )


def _upright(law: str) -> float:
    """Stress per depth and strength against an upright plate's motion [-]."""
    face = at_unit_depth(np.array([[1.0, 0.0, 0.0]]))
    return -float(surface_force(face, Sand(xi_n=1.0, zeta=1.0), law, velocity=(1.0, 0.0, 0.0)).stress[0, 0])


def sand_line(parameters: Mapping[str, object]) -> str:
    """The call of `Sand` that makes the sand of these parameters, as text."""
    shown = ", ".join(
        f"{key}={f'{value:.4g}' if isinstance(value, float) else repr(value)}" for key, value in parameters.items()
    )
    return f"Sand({shown})"
