"""Measured plates: a campaign of rftsim_mpm, or a CSV.

Angles as in [Agarwal] eq. (5.14): the lower face's normal is m = (sin b cos p, sin b sin p, -cos b) and the plate moves
along (cos g, 0, -sin g), for b = beta, g = gamma, p = psi.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rftsim.errors import RftsimError
from rftsim.fit.columns import read_columns
from rftsim.law.leading import leads
from rftsim.surface.triangles import EDGE_ON_DOUBLE, Array, Surface

ANGLES: Final = ("beta", "gamma", "psi")
"""Names of the angles of a plate and its motion."""
ALPHA: Final = ("alpha_x", "alpha_y", "alpha_z")
"""Names of the components of a plate's stress per depth."""
SAND: Final = ("rho", "mu_int", "mu_surf")
"""Names of what tells the sands of a campaign's plates apart."""


class Plates(NamedTuple):
    """Plates as they were set and moved, and the forces that they felt."""

    angles: Array
    """Angles beta, gamma and psi [deg], shape (n, 3)."""
    alpha: Array
    """Force per area and depth [N/m^3], shape (n, 3)."""
    thickness: Array
    """Thickness over the plate's length [-], shape (n,); zero where it is unknown."""
    depth: Array
    """Depth of the leading face's centre over the plate's length [-], shape (n,)."""

    @property
    def n(self) -> int:
        """The number of plates that were measured."""
        return len(self.alpha)

    def take(self, chosen: Any) -> "Plates":
        """The plates that an index, a slice or a mask of NumPy chooses."""
        return Plates(*(column[chosen] for column in self))


class Campaign(NamedTuple):
    """The square plates of a campaign that share one sand."""

    plates: Plates
    """The plates themselves."""
    sand: dict[str, float]
    """Their rho [kg/m^3], mu_int [-] and mu_surf [-] by name."""
    flat: list[dict[str, float]]
    """Every flat plate pushed straight down, whatever its sand: mu_int, mu_surf, rho, alpha_z."""
    notes: list[str]
    """Sentences that say what is not there yet, damaged, or not the same in all."""


class Faces(NamedTuple):
    """The faces of plates that the sand presses on, k of them."""

    row: "np.ndarray[tuple[int], np.dtype[np.int64]]"
    """Number of the plate that each is of, shape (k,)."""
    normal: Array
    """Outward unit normals, shape (k, 3)."""
    motion: Array
    """Directions of motion, shape (k, 3)."""
    weight: Array
    """Area times depth over that of the plate [-], shape (k,)."""

    @property
    def edge_on(self) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
        """Whether each face moves along itself, shape (k,)."""
        found: np.ndarray[tuple[int], np.dtype[np.bool_]] = np.abs((self.normal * self.motion).sum(axis=1)) <= (
            EDGE_ON_DOUBLE
        )
        return found


def directions(angles: Array) -> tuple[Array, Array]:
    """Normals of lower faces and directions of motion, shape (n, 3) each, from angles [deg], shape (n, 3)."""
    beta, gamma, psi = np.radians(angles).T
    m = np.stack([np.sin(beta) * np.cos(psi), np.sin(beta) * np.sin(psi), -np.cos(beta)], axis=1)
    v = np.stack([np.cos(gamma), np.zeros_like(gamma), -np.sin(gamma)], axis=1)
    return m.round(15), v.round(15)  # cos 90 degrees is nothing


def leading_faces(plates: Plates) -> Faces:
    """The faces that lead, n.v >= 0, narrow ones too: of a plate that moves edge-on, both wide ones, as in the laws.

    The source takes plates for infinitely thin; with their edges counted, the law explains them better.
    """
    m, v = directions(plates.angles)
    beta, psi = np.radians(plates.angles[:, 0]), np.radians(plates.angles[:, 2])
    across = np.stack([-np.sin(psi), np.cos(psi), np.zeros_like(psi)], axis=1)
    along = np.stack([np.cos(beta) * np.cos(psi), np.cos(beta) * np.sin(psi), np.sin(beta)], axis=1)
    t = plates.thickness[:, None]
    front = np.where(leads(m, v, EDGE_ON_DOUBLE)[:, None], m, -m)
    found = []
    for normal, reach, area in [(m, t / 2, 1.0), (-m, t / 2, 1.0)] + [
        (side * axis, 0.5, t[:, 0]) for axis in (along, across) for side in (1.0, -1.0)
    ]:
        lower = (front * t / 2 - normal * reach)[:, 2] / plates.depth
        found.append((normal.round(15), area * np.maximum(1.0 + lower, 0.0)))
    row = np.tile(np.arange(plates.n), len(found))
    normal, weight = (
        np.concatenate([n for n, _ in found]),
        np.concatenate([w * np.ones(plates.n) for _, w in found]),
    )
    leading = leads(normal, v[row], EDGE_ON_DOUBLE) & (weight > 0.0)
    return Faces(row[leading], normal[leading], v[row][leading], weight[leading])


def at_unit_depth(normal: Array, where: ArrayLike = (0.0, 0.0, 0.0)) -> Surface:
    """A surface of one triangle for each normal, shape (k, 3), with its centre a metre below `where`, (k, 3)."""
    aside = np.where(np.abs(normal[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    a = np.cross(normal, aside)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(normal, a)
    corners = [np.cos(t) * a + np.sin(t) * b for t in 2.0 * np.pi / 3.0 * np.arange(3)]
    centres = np.broadcast_to(where, normal.shape) - np.array([0.0, 0.0, 1.0])
    return Surface(np.stack(corners, axis=1) + centres[:, None, :])


def read_csv(path: Path) -> Plates:
    """The plates of a CSV with columns beta, gamma, psi [deg], alpha_x, alpha_y, alpha_z [N/m^3]; psi may be left out.

    Raises:
        RftsimError: The file is missing or a column is.
    """
    table = read_columns(path, ("beta", "gamma", *ALPHA), ("psi",))
    psi = table.get("psi", np.zeros_like(table["beta"]))
    angles = np.stack([table["beta"], table["gamma"], psi], axis=1)
    for name, column, most in zip(ANGLES, angles.T, (90.0, 90.0, 180.0), strict=True):
        if np.abs(column).max() > most:
            raise RftsimError(
                f"{path}: {name} must be within {most:g} degrees, not {column[np.abs(column).argmax()]:g}"
            )
    n = len(angles)
    return Plates(angles, np.stack([table[name] for name in ALPHA], axis=1), np.zeros(n), np.ones(n))


def read_campaign(folder: Path, wanted: Mapping[str, float]) -> Campaign:
    """The square plates of a campaign's folder that share one sand: that of most plates, or the wanted one.

    Args:
        folder: With manifest.json and results/KEY.json, as `rftsim-mpm campaign` makes it.
        wanted: Any of rho, mu_int and mu_surf.

    Raises:
        RftsimError: It is no campaign, or has no such plates.
    """
    results, notes = _results(folder)
    sands: dict[tuple[float, ...], list[dict[str, Any]]] = {}
    for result in results:
        sands.setdefault(tuple(float(result["plate"][name]) for name in SAND), []).append(result)
    fitting = [key for key in sands if all(key[SAND.index(name)] == x for name, x in wanted.items())]
    if not fitting:
        there = "; ".join("rho {:g}, mu_int {:g}, mu_surf {:g}".format(*key) for key in sands) or "none"
        raise RftsimError(f"{folder} has no finished square plates in such a sand; it has {there}")
    chosen = max(fitting, key=lambda key: len(sands[key]))
    own = [result["plate"] for result in sands[chosen]]
    for name in ("length", "thickness", "depth", "speed", "cells", "bed"):
        values = sorted({plate.get(name) for plate in own}, key=str)
        if len(values) > 1:
            notes.append(f"the plates differ in {name}: {', '.join(map(str, values))}")
    plates = Plates(
        np.array([[plate[name] for name in ANGLES] for plate in own], dtype=float),
        np.array([result["alpha_N_m3"] for result in sands[chosen]], dtype=float),
        np.array([(plate["thickness"] or 0.2 * plate["length"]) / plate["length"] for plate in own]),
        np.array([result["depth_m"] / result["plate"]["length"] for result in sands[chosen]]),
    )
    flat = [
        {name: float(result["plate"][name]) for name in ("mu_int", "mu_surf", "rho")}
        | {"alpha_z": float(result["alpha_N_m3"][2])}
        for result in results
        if result["plate"]["beta"] == 0.0 and result["plate"]["gamma"] == 90.0
    ]
    return Campaign(
        plates,
        dict(zip(SAND, chosen, strict=True)),
        sorted(flat, key=lambda row: (row["mu_int"], row["mu_surf"])),
        notes,
    )


def _results(folder: Path) -> tuple[list[dict[str, Any]], list[str]]:
    """Every whole result of a square plate, and what is amiss."""
    try:
        keys = sorted(json.loads((folder / "manifest.json").read_text())["plates"])
    except OSError as error:
        raise RftsimError(f"{folder} is no campaign: cannot read manifest.json ({error.strerror})") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise RftsimError(f"{folder / 'manifest.json'} is damaged: run the campaign's TOML file again") from None
    results, missing, damaged = [], 0, []
    for key in keys:
        path = folder / "results" / f"{key}.json"
        if not path.exists():
            missing += 1
        elif (result := _whole(path)) is None:
            damaged.append(key)
        elif result["plate"]["dim"] == 3:
            results.append(result)
    notes = [f"{missing} of {len(keys)} plates of {folder} are not computed yet"] if missing else []
    notes += [f"left out {len(damaged)} damaged results, the first {damaged[0]}"] if damaged else []
    return results, notes


def _whole(path: Path) -> dict[str, Any] | None:
    """A result, if it is what was written."""
    try:
        result: dict[str, Any] = json.loads(path.read_text())
        written = result.pop("sha256")
        canonical = json.dumps(result, sort_keys=True, separators=(",", ":"))
        return result if hashlib.sha256(canonical.encode()).hexdigest() == written else None
    except (OSError, ValueError, KeyError, AttributeError, TypeError):
        return None
