"""Plates dragged and pushed at several speeds: [Agarwal] section 4.7 and figures B-2 and B-3.

What a dynamic law gives is a static force plus lambda rho A v_n^2; that both come back from a fit checks the whole way
from mesh and sand to force, not the physics.
"""

import functools
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from rftsim.law.rigid import surface_force
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import Array, Surface
from rftsim.validation.study import Measured, Request, Row, near

DRAG_DEPTHS: Final = (0.02, 0.03, 0.04)
"""Depths of the dragged plate's centre [m]."""
DRAG_SPEEDS: Final = (1e-6, 0.04, 0.1, 0.2, 0.32, 0.48, 0.64)
"""Speeds of the dragged plate [m/s]."""
DRAG_LENGTH: Final = 0.016
"""Height of the dragged plate [m]."""
DRAG_SAND: Final = Sand(rho_c=900.0, lambda_=1.1, zeta=1.0)
"""Sand of the dragged plate, but for its strength."""
K_DRAG: Final = 580.0
"""Static drag over depth, per metre of width [N/m^2]."""
DRAG_FORCES: Final = {0.02: 11.6, 0.03: 17.4, 0.04: 23.2}
"""Static drag K |z| by depth, per metre of width, [Agarwal] section 4.7 [N/m]."""
DRAG_INERTIA: Final = 6.5
"""Drag that is added at 0.64 m/s, per metre of width, [Agarwal] section 4.7 [N/m]."""

PUSH_LENGTH, PUSH_DEPTH = 0.16, 0.16
"""Length and depth of the plate that is pushed down [m]."""
PUSH_SPEEDS: Final = (1e-6, 0.5, 1.0, 2.0, 3.0)
"""Speeds of the plate that is pushed down [m/s]."""
PUSH_SAND: Final = Sand(rho_c=2500.0, mu_int=0.62, lambda_=2.8)
"""Sand of the plate that is pushed down."""

OBLIQUE_ANGLES_DEG: Final = (15, 30, 45, 60, 75, 90)
"""Angles between the oblique plates and their velocity [deg]."""
OBLIQUE_SPEEDS: Final = (1e-6, 0.05, 0.25, 0.5, 0.75)
"""Speeds of the oblique plates [m/s]."""
OBLIQUE_LENGTH, OBLIQUE_DEPTH = 0.03, 0.012
"""Width and submerged height of the oblique plates [m]."""
OBLIQUE_SAND: Final = Sand(rho_c=1450.0, mu_int=0.4, mu_surf=0.4, lambda_=1.1)
"""Sand of the oblique plates."""


def face(normal: Array, length: float, width: float) -> Surface:
    """Make the leading face of a thin plate about the origin, `width` across y where it can be.

    Args:
        normal: Its outward unit normal, shape (3,).
        length: Its extent in the other direction [m].
        width: Its extent along the horizontal direction in the plate [m].
    """
    across = np.array([-normal[1], normal[0], 0.0]) if abs(normal[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    across = across / np.linalg.norm(across)
    along = np.cross(normal, across)
    corners = [a * width / 2 * across + b * length / 2 * along for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    quad = np.array(corners)
    return Surface(quad[[[0, 1, 2], [0, 2, 3]]])


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """Jobs for plates that are dragged, pushed down and oblique."""
    return {"drag": drag, "push": push, "oblique": functools.partial(oblique, OBLIQUE_ANGLES_DEG)}


def drag() -> dict[str, Any]:
    """Drag per metre of width [N/m] on an upright plate over depth and speed, by DRFT."""
    plate = face(np.array([1.0, 0.0, 0.0]), DRAG_LENGTH, 1.0)

    def force(sand: Sand, depth: float, speed: float) -> float:
        moved = surface_force(plate, sand, "drft2d", position=(0, 0, -depth), velocity=(speed, 0, 0))
        return -float(moved.force[0])

    unit = force(DRAG_SAND, 1.0, 1e-9)
    sand = DRAG_SAND.replace(zeta=K_DRAG / unit)  # the sand in which a slow plate has the published K
    found = [[force(sand, depth, speed) for speed in DRAG_SPEEDS] for depth in DRAG_DEPTHS]
    z, v = np.meshgrid(DRAG_DEPTHS, DRAG_SPEEDS, indexing="ij")
    stiffness, inertia = fit_terms(z, DRAG_SAND.density() * DRAG_LENGTH * v**2, np.array(found))
    return {"force": found, "stiffness": stiffness, "inertia": inertia, "zeta": sand.zeta}


def push() -> dict[str, Any]:
    """Force per metre of width [N/m] on a flat plate pushed straight down, over speed, by DRFT."""
    plate = face(np.array([0.0, 0.0, -1.0]), PUSH_LENGTH, 1.0)
    found = []
    for speed in PUSH_SPEEDS:
        moved = surface_force(plate, PUSH_SAND, "drft2d", position=(0, 0, -PUSH_DEPTH), velocity=(0, 0, -speed))
        found.append(float(moved.force[2]))
    v2 = np.array(PUSH_SPEEDS) ** 2
    static, inertia = fit_terms(np.full(len(v2), PUSH_DEPTH), PUSH_SAND.density() * PUSH_LENGTH * v2, np.array(found))
    return {"force": found, "stiffness": static, "inertia": inertia, "zeta": PUSH_SAND.zeta}


def oblique(angles_deg: tuple[int, ...]) -> dict[str, Any]:
    """Normal force [N] on an upright plate, its lower edge at the depth, turned to its velocity, by 3D-DRFT."""
    found, inertia = [], []
    for angle in np.radians(angles_deg):
        normal = np.array([np.sin(angle), np.cos(angle), 0.0])
        plate = face(normal, OBLIQUE_DEPTH, OBLIQUE_LENGTH)  # its submerged part
        force = []
        for speed in OBLIQUE_SPEEDS:
            moved = surface_force(
                plate, OBLIQUE_SAND, "drft3d", position=(0, 0, -OBLIQUE_DEPTH / 2), velocity=(speed, 0, 0)
            ).force
            force.append(-float(moved @ normal))
        v_n2 = (np.array(OBLIQUE_SPEEDS) * np.sin(angle)) ** 2
        area = OBLIQUE_LENGTH * OBLIQUE_DEPTH
        inertia.append(fit_terms(np.ones(len(force)), OBLIQUE_SAND.density() * area * v_n2, np.array(force))[1])
        found.append(force)
    return {"force": found, "inertia": inertia, "angles_deg": list(angles_deg)}


def fit_terms(static: Array, dynamic: Array, force: Array) -> tuple[float, float]:
    """Fit the factors of the static and the dynamic term of a force by least squares."""
    basis = np.column_stack([static.ravel(), dynamic.ravel()])
    (first, second), *_ = np.linalg.lstsq(basis, force.ravel(), rcond=None)
    return float(first), float(second)


def rows(measured: Measured) -> list[Row]:
    """The rows of the terms that go in, and must come out."""
    found = []
    dragged, pushed, oblique = (measured[name] for name in ("drag", "push", "oblique"))
    published, own = "[Agarwal] section 4.7", "what the law was given: exact"
    for depth, force in zip(DRAG_DEPTHS, dragged["force"], strict=True):
        what = f"drag at {1e3 * depth:g} mm, slow"
        found.append(near(what, force[0], DRAG_FORCES[depth], 0.05, published, unit="N/m", note="ζ is that of K"))
    added = dragged["force"][0][-1] - dragged["force"][0][0]
    worst = max(oblique["inertia"], key=lambda value: abs(float(value) - OBLIQUE_SAND.lambda_))
    return [
        *found,
        near("drag: added at 0.64 m/s", added, DRAG_INERTIA, 0.05, published, unit="N/m"),
        near("drag: K by fit", dragged["stiffness"], K_DRAG, 0.1, own, unit="N/m²"),
        near("drag: λ by fit", dragged["inertia"], DRAG_SAND.lambda_, 1e-4, own),
        near("vertical plate: λ by fit", pushed["inertia"], PUSH_SAND.lambda_, 1e-4, "the same, [Agarwal] Fig. B-3"),
        near(
            "vertical plate: static stress over ζ z",
            pushed["stiffness"] / (pushed["zeta"] * PUSH_LENGTH),
            1.0,
            1e-3,
            "[Agarwal] Table 3.1: α_z(0, π/2)",
        ),
        near("oblique plates: λ by fit, worst angle", worst, OBLIQUE_SAND.lambda_, 1e-4, "the same, Fig. B-2"),
    ]


def draw(measured: Measured, figure: Any) -> None:
    """Draw force over speed of the three kinds, with the published line where there is one."""
    left, middle, right = figure.subplots(1, 3)
    dragged, pushed, oblique = (measured[name] for name in ("drag", "push", "oblique"))
    v = np.linspace(0.0, 0.64, 50)
    for k, (depth, force) in enumerate(zip(DRAG_DEPTHS, dragged["force"], strict=True)):
        left.plot(DRAG_SPEEDS, force, "o", color=f"C{k}", label=f"drft2d, {1e3 * depth:g} mm")
        line = K_DRAG * depth + 1.1 * 900 * DRAG_LENGTH * v**2
        left.plot(v, line, "--", color=f"C{k}", label="published fit" if k == 2 else None)
    left.set_title("dragged, $K|z|+\\lambda\\rho L v^2$", fontsize=10)
    left.set_ylabel("force per width [N/m]")
    middle.plot(PUSH_SPEEDS, 1e-3 * np.array(pushed["force"]), "o", label=f"drft2d, {1e3 * PUSH_DEPTH:g} mm")
    v = np.linspace(0.0, max(PUSH_SPEEDS), 50)
    line = pushed["zeta"] * PUSH_LENGTH * PUSH_DEPTH + 2.8 * 2500 * PUSH_LENGTH * v**2
    middle.plot(v, 1e-3 * line, "--", color="C0", label="$\\zeta L z + \\lambda\\rho L v^2$")
    middle.set_title("pushed down, λ 2.8", fontsize=10)
    middle.set_ylabel("force per width [kN/m]")
    for k, (speed, force) in enumerate(zip(OBLIQUE_SPEEDS[1:], np.array(oblique["force"]).T[1:], strict=True)):
        right.plot(oblique["angles_deg"], force, "o-", color=f"C{k}", label=f"drft3d, {speed:g} m/s")
    right.set_title("oblique, 30 mm wide, 12 mm deep", fontsize=10)
    right.set_xlabel("angle between plate and velocity [deg]")
    right.set_ylabel("normal force [N]")
    for axis in (left, middle):
        axis.set_xlabel("speed [m/s]")
    for axis in (left, middle, right):
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
