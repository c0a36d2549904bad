"""Surfaces and motions that the tests share."""

import numpy as np
import trimesh

from rftsim import Sand, Surface, make_surface, surface_force

ONE = Sand(xi_n=1.0, zeta=1.0, mu_surf=1e9, rho_c=1.0)
"""Sand of unit strength whose friction never limits, so that force / (area depth) is the law's alpha."""


def unit(x):
    x = np.asarray(x, dtype=float)
    return x / np.linalg.norm(x)


def plate(normal, area=1.0, centre=(0.0, 0.0, -1.0)):
    """One triangle of a given normal, area [m^2] and centroid [m]."""
    n = unit(normal)
    a = unit(np.cross(n, [1.0, 0.0, 0.0] if abs(n[0]) < 0.9 else [0.0, 1.0, 0.0]))
    b = np.cross(n, a)
    corners = np.array([np.cos(t) * a + np.sin(t) * b for t in 2 * np.pi / 3 * np.arange(3)])
    return Surface((corners * np.sqrt(area / (0.75 * np.sqrt(3.0))) + centre)[None])


def alpha(normal, velocity, law="rft3d", sand=ONE, **where):
    """Stress per depth [N/m^3] on a plate at unit depth."""
    return surface_force(plate(normal), sand, law, velocity=velocity, **where).force


def rotation(rng):
    """A random rotation, uniform."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def about(axis, angle):
    return trimesh.transformations.rotation_matrix(angle, axis)[:3, :3]


def blob(rng, subdivisions=2, size=0.1):
    """A closed, dented, lopsided body."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    waves = rng.normal(size=(5, 3)) * 2.0
    radius = 1.0 + 0.15 * np.sin(ball.vertices @ waves.T + rng.uniform(0, 6, size=5)).sum(axis=1) / np.sqrt(5)
    return make_surface(ball.vertices * radius[:, None] * size * rng.uniform(0.5, 1.5, size=3), ball.faces)


def rim(radius=0.106, width=0.06, sections=48, axis=1):
    """A wheel: a cylinder about y (or another axis), its rim in fine strips."""
    mesh = trimesh.creation.cylinder(radius=radius, height=width, sections=sections)
    vertices = np.roll(mesh.vertices, axis - 2, axis=1)
    return make_surface(vertices, mesh.faces)
