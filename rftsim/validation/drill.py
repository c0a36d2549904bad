"""The drilling cylinder of [Agarwal] section 5.10: force, moment and stress, and the filter of small features."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from rftsim_models.outline import extruded

from rftsim.law.rigid import SurfaceForce, surface_force
from rftsim.sand.medium import Sand
from rftsim.sand.presets import PRESETS
from rftsim.sand.strength import xi_n_cubic
from rftsim.surface.solids import revolved
from rftsim.surface.triangles import Array, Surface, make_surface
from rftsim.validation.study import Measured, Request, Row, at_most, near

RADIUS, LENGTH = 0.025, 0.14
"""Radius and length of both cylinders [m]."""
EDGE: Final = 0.0025
"""Edge of the triangles of the DEM's cylinder [m]: finer than the cut-off, without which no edge is seen."""
DEPTHS: Final = (0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.12)
"""Depths of the lower end at which the drill is evaluated [m]."""
DEM_DEPTH: Final = 0.1
"""Depth of the lower end at which [Agarwal] Fig. 5-9 C shows the stress [m]."""
SINKING: Final = (0.0, 0.0, -0.1)
"""Velocity of both cylinders [m/s]."""
TURNING: Final = (0.0, 0.0, -4 * np.pi)
"""Angular velocity of the DEM's drill [rad/s]."""
CUT_OFF: Final = 0.0048
"""Smallest radius of curvature that the sand resists, [Agarwal] Fig. C-6 [m]; three grain radii."""


def lying() -> Surface:
    """Make a cylinder for the other program's, its axis along y: a prism of 128 sides, one of them down, in fine rows.

    That program's mesh is not published. A finer one moves force and moment by 2e-4, as triangles then lead or not.
    """
    rings = np.linspace(0.0, RADIUS, 50, endpoint=False)
    ends = np.full(50, LENGTH / 2)
    radius = np.concatenate([rings, np.full(321, RADIUS), rings[::-1]])
    height = np.concatenate([-ends, np.linspace(-LENGTH / 2, LENGTH / 2, 321), ends])
    half = np.pi / 128
    turn = np.array([[np.cos(half), -np.sin(half), 0.0], [np.sin(half), np.cos(half), 0.0], [0.0, 0.0, 1.0]])
    return Surface((revolved(np.column_stack([radius, height]), 128) @ turn.T)[..., [1, 2, 0]])


def upright(edge: float = EDGE) -> Surface:
    """Make the cylinder of the DEM, its axis along z and its lower end at the origin, of triangles of an edge [m]."""
    angle = np.linspace(0.0, 2 * np.pi, round(2 * np.pi * RADIUS / edge), endpoint=False)
    circle = RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    solid = extruded(circle, LENGTH, rings=round(RADIUS / edge), strips=round(LENGTH / edge))
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    return make_surface(*solid).moved(turn, (0.0, 0.0, LENGTH / 2))


def curvature_radius(surface: Surface) -> Array:
    """Smallest radius of curvature at each triangle's corners [m], shape (ntri, 3), [Agarwal] section C.7.

    Discrete principal curvatures H ± (H² - K)^1/2, with the mean curvature H by the cotangent formula and Gauss's K by
    the angle deficit, each over a third of the area of the triangles around.
    """
    import trimesh

    mesh = trimesh.Trimesh(*_welded(surface), process=False)
    corners = mesh.triangles
    angles = mesh.face_angles
    area = np.bincount(mesh.faces.ravel(), np.repeat(mesh.area_faces / 3.0, 3), minlength=len(mesh.vertices))
    bend = np.zeros_like(mesh.vertices)
    for k in range(3):
        i, j = mesh.faces[:, (k + 1) % 3], mesh.faces[:, (k + 2) % 3]
        side = (corners[:, (k + 1) % 3] - corners[:, (k + 2) % 3]) / np.tan(angles[:, k])[:, None]
        np.add.at(bend, i, side)
        np.add.at(bend, j, -side)
    mean = np.linalg.norm(bend, axis=1) / (4.0 * area)
    gauss = (2 * np.pi - np.bincount(mesh.faces.ravel(), angles.ravel(), minlength=len(area))) / area
    largest = mean + np.sqrt(np.maximum(mean**2 - gauss, 0.0))
    return np.asarray(1.0 / np.maximum(largest, 1e-9)[mesh.faces])


def _welded(surface: Surface) -> tuple[Array, Any]:
    """Corners that triangles share, (n, 3) [m], and their indices in each triangle, (ntri, 3)."""
    points = surface.triangles.reshape(-1, 3)
    _, first, inverse = np.unique(np.round(points / 1e-9), axis=0, return_index=True, return_inverse=True)
    return points[first], inverse.reshape(-1, 3)


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """Jobs for the other program's cylinder, and for the drill of the DEM over its depth."""
    return {"program": program, "drill": drill}


def program() -> dict[str, float]:
    """Vertical force [N] and moment [N m] on the lying cylinder, its centre at 100 mm."""
    sand = Sand(xi_n=xi_n_cubic(1310, 0.21), mu_surf=0.4)
    found = surface_force(lying(), sand, position=(0, 0, -0.1), velocity=SINKING, angular_velocity=(0, 0, -np.pi))
    return {"force": float(found.force[2]), "moment": float(found.moment[2])}


def _drilled(depth: float, edge: float = EDGE) -> SurfaceForce:
    sand = PRESETS["dem-glass-beads"]
    return surface_force(upright(edge), sand, position=(0, 0, -depth), velocity=SINKING, angular_velocity=TURNING)


def drill() -> dict[str, Any]:
    """Force [N] and moment [N m] on the DEM's drill over its depth, and the share left without sharp triangles."""
    states = [_drilled(depth) for depth in DEPTHS]
    at = _drilled(DEM_DEPTH)
    return {
        "depth": list(DEPTHS),
        "force": [state.force.tolist() for state in states],
        "moment": [state.moment.tolist() for state in states],
        "at": {"force": at.force.tolist(), "moment": at.moment.tolist()},
        "filtered": _filtered(EDGE),
        "filtered_fine": _filtered(EDGE / 2),
    }


def _filtered(edge: float) -> float:
    """Share of the vertical force [-] that is left when the sand does not resist what is too sharp."""
    surface, state = upright(edge), _drilled(DEM_DEPTH, edge)
    kept = _is_round(surface)
    return float(state.stress[kept, 2] @ surface.areas[kept] / state.force[2])


def _is_round(surface: Surface) -> Any:
    return (curvature_radius(surface) >= CUT_OFF).all(axis=1)


def rows(measured: Measured) -> list[Row]:
    """The rows of an independent program's numbers; those of the DEM are not printed in the thesis."""
    other, at = measured["program"], measured["drill"]["at"]
    source = "independent program"
    figure = "[Agarwal] Fig. 5-9: a figure only, no number printed"
    aside = max(abs(at["force"][0]), abs(at["force"][1])) / at["force"][2]
    share, fine = (100 * measured["drill"][name] for name in ("filtered", "filtered_fine"))
    mesh = f"{fine:.0f} % on half the edge: at a sharp rim the filter follows the mesh"
    return [
        near("lying cylinder: F_z", other["force"], 65.2757, 65.2757e-5, source, unit="N"),
        near("lying cylinder: M_z", other["moment"], 1.43203, 1.43203e-5, source, unit="N m"),
        at_most("drill: sideways over vertical force", 100 * aside, 0.1, "symmetry", unit="%"),
        Row("drill at 100 mm: F_z", at["force"][2], figure, unit="N"),
        Row("drill at 100 mm: M_z", at["moment"][2], figure, unit="N m", note="2 % less on half the edge"),
        Row("drill: F_z left by the curvature filter", share, "[Agarwal] C.7, R_c ≥ 4.8 mm", unit="%", note=mesh),
        Row("bunny drill", None, "[Agarwal] Fig. 5-10", note="no mesh of the bunny comes with any installed package"),
    ]


def draw(measured: Measured, figure: Any) -> None:
    """Draw force and moment over depth, and the stress on each triangle."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import PowerNorm
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    found = measured["drill"]
    left, middle = figure.add_subplot(1, 4, 1), figure.add_subplot(1, 4, 2)
    depth = 1e3 * np.array(found["depth"])
    for axis, name, unit in ((left, "force", "N"), (middle, "moment", "N m")):
        for k, component in enumerate("xyz"):
            axis.plot(depth, np.array(found[name])[:, k], "o-", color=f"C{k}", label=f"{name[0].upper()}$_{component}$")
        axis.set_xlabel("depth of the lower end [mm]")
        axis.set_ylabel(f"{name} of the sand [{unit}]")
        axis.grid(alpha=0.3)
        axis.legend()
    surface, state = upright(), _drilled(DEM_DEPTH)
    triangles = 1e3 * (surface.triangles - [0.0, 0.0, DEM_DEPTH])
    stress = 1e-3 * np.linalg.norm(state.stress, axis=1)
    scale = ScalarMappable(PowerNorm(0.5, 0.0, float(stress.max())), "viridis")
    for place, title in ((3, "stress at 100 mm, from below"), (4, "red: dropped by the curvature filter")):
        axis = figure.add_subplot(1, 4, place, projection="3d")
        colours = scale.to_rgba(stress)
        if place == 4:
            colours[~_is_round(surface)] = (0.8, 0.1, 0.1, 1.0)
        axis.add_collection3d(Poly3DCollection(triangles, facecolors=colours, edgecolors=colours, linewidths=0.2))
        axis.set(xlim=(-40, 40), ylim=(-40, 40), zlim=(-110, 50))
        axis.set_box_aspect((80, 80, 160), zoom=1.2)
        axis.view_init(elev=-25, azim=40)
        axis.set_axis_off()
        axis.set_title(title, fontsize=10)
    figure.colorbar(scale, ax=axis, label="stress [kPa]", shrink=0.7)
