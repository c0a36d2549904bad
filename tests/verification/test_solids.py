"""Tessellations and splits that replace trimesh's: the same, triangle by triangle."""

import numpy as np
import pytest
import trimesh

from rftsim import make_surface
from rftsim.surface import solids
from rftsim.surface.splitting import split


@pytest.mark.parametrize("subdivisions", [0, 2, 3])
def test_ball_is_the_icosphere(subdivisions):
    """To the last bit, from one subdivision on."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    np.testing.assert_allclose(solids.ball(subdivisions), mesh.triangles, rtol=0, atol=0 if subdivisions else 3e-16)


def test_solids_of_revolution_and_box():
    """A cylinder and a capsule, inscribed, and a box."""
    pairs = [
        (solids.box(np.array([0.1, 0.2, 0.3])), trimesh.creation.box(extents=[0.1, 0.2, 0.3])),
        (solids.cylinder(0.1, 0.04, 24), trimesh.creation.cylinder(radius=0.1, height=0.04, sections=24)),
        (solids.capsule(0.1, 0.04, 12, 24), trimesh.creation.capsule(radius=0.1, height=0.04, count=[24, 12])),
    ]
    for ours, theirs in pairs:
        np.testing.assert_array_equal(ours, theirs.triangles)
        assert solids.volume(ours) == theirs.volume


def test_tiny_capsule_is_closed():
    """One of a micrometre has all its triangles, where an absolute tolerance would drop those at its ends."""
    ours, large = (scale * solids.capsule(0.1 / scale, 0.04 / scale, 12, 24) for scale in (1e5, 1.0))
    np.testing.assert_allclose(ours, large, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("mesh", [trimesh.creation.torus(1.0, 0.3), trimesh.creation.box((1.0, 2.0, 3.0))])
@pytest.mark.parametrize("max_edge", [0.05, 0.17, 0.9])
def test_split_is_subdivide_to_size(mesh, max_edge):
    """And leaves no gap between neighbours."""
    ours = split(np.array(mesh.triangles), max_edge)
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, max_edge, max_iter=20)
    np.testing.assert_array_equal(ours, vertices[faces])
    assert make_surface(ours.reshape(-1, 3), range(3 * len(ours))).ntri == len(ours)
