"""Facets in place of triangles: what they keep exactly, and what within the tolerance."""

import dataclasses

import numpy as np
import pytest
import trimesh
from rftsim_models import wheels
from rftsim_models.outline import extruded
from shapes import ONE, blob, rim

from rftsim import PRESETS, FreeSurface, make_surface, surface_force
from rftsim.law.laws import get_law
from rftsim.law.layout import BLOCK, pack_bed
from rftsim.reduction.facets import fused, merged, settled, split
from rftsim.reduction.measure import errors, scaled_wrenches
from rftsim.reduction.reduce import reduced
from rftsim.reduction.samples import DEPTHS, HELD_BACK, draw, free_reach
from rftsim.surface.triangles import Surface, Wheel

BED = pack_bed(PRESETS["poppy-seeds"], get_law("rft3d"), FreeSurface(), (0, 1, 0))


def volume(surface):
    return np.einsum("ij,ij,i->", surface.centres, surface.normals, surface.areas) / 3


def closure(surface):
    return np.linalg.norm(surface.normals.T @ surface.areas) / surface.areas.sum()


def _box():
    mesh = trimesh.creation.box((0.3, 0.2, 0.1)).subdivide().subdivide().subdivide()
    return make_surface(mesh.vertices, mesh.faces)


@pytest.mark.parametrize("count", [2, 30, 500])
def test_facets_close_and_keep_the_volume(count):
    """sum n A = 0 and sum c . n A / 3 = V, however the triangles are put together."""
    rng = np.random.default_rng(count)
    surface = blob(rng, subdivisions=4)
    labels = np.append(np.arange(count), rng.integers(count, size=surface.ntri - count))
    facets = merged(surface, labels)
    assert facets.ntri == count
    assert closure(facets) < 1e-12
    assert volume(facets) == pytest.approx(volume(surface), rel=1e-12)
    assert facets.size == surface.size


def test_a_facet_of_each_triangle_is_that_triangle():
    """Nothing changes where nothing is put together."""
    surface = blob(np.random.default_rng(0))
    facets = merged(surface, np.arange(surface.ntri))
    for name in ("centres", "normals", "areas"):
        np.testing.assert_allclose(getattr(facets, name), getattr(surface, name), rtol=1e-9, atol=1e-12)


def test_buried_flat_faces_are_exact():
    """Depth is linear, so a box drawn through the sand feels the same in 6 facets as in 768 triangles."""
    box = _box()
    facets = merged(box, np.unique(np.round(box.normals), axis=0, return_inverse=True)[1])
    assert facets.ntri == 6
    motion = {"position": (0, 0, -0.5), "velocity": (0.3, -0.2, -0.1)}
    forces = [surface_force(surface, ONE, **motion).force for surface in (box, facets)]
    np.testing.assert_allclose(*forces, rtol=1e-12)


def test_both_sides_of_a_plate_in_one_facet_push_nowhere():
    """A cluster whose area vectors cancel keeps its place and no area to speak of."""
    box = _box()
    facets = merged(box, np.zeros(box.ntri, dtype=int))
    assert facets.areas[0] < 1e-12 * box.areas.sum()
    assert np.isfinite(facets.centres).all()


def test_splitting_and_settling_cover_all_triangles():
    """Clusters are numbered without gaps, and each split adds one."""
    surface = blob(np.random.default_rng(1))
    points, labels = np.hstack([surface.centres, surface.normals]), np.zeros(surface.ntri, dtype=int)
    for count in (2, 4, 8, 16):
        labels = split(labels, np.arange(count // 2), points, surface.areas)
        assert np.array_equal(np.unique(labels), np.arange(count))
    settled_labels = settled(labels, points, surface.areas)
    assert np.array_equal(np.unique(settled_labels), np.arange(settled_labels.max() + 1))


def test_fusing_takes_the_cheapest_pairs():
    """Each cluster goes into its nearest, once at most, as many as were asked for."""
    points, weights = np.array([[0.0], [0.1], [1.0], [1.1], [5.0], [5.2]]), np.ones(6)
    apart, costs = np.arange(6), np.array([9.0, 9.0, 1.0, 1.0, 5.0, 5.0])
    np.testing.assert_array_equal(fused(apart, 1, costs, points, weights), [0, 1, 2, 2, 3, 4])
    np.testing.assert_array_equal(fused(apart, 2, costs, points, weights), [0, 1, 2, 2, 3, 3])
    np.testing.assert_array_equal(fused(apart, 9, costs, points, weights), [0, 0, 1, 1, 2, 2])


def fresh_error(surface, facets, seeds, depths):
    """Largest error over poses and motions that nothing was chosen by."""
    worst = 0.0
    for seed in seeds:
        samples = draw(surface, BED, free_reach(seed), depths, seed)
        pair = [scaled_wrenches(s, BED, samples) for s in (surface, facets)]
        worst = max(worst, float(errors(*pair, samples.depth).max()))
    return worst


def test_tolerance_is_kept():
    """The error is as said where it was measured, under twice the tolerance elsewhere, with fewer elements."""
    surface = blob(np.random.default_rng(2), subdivisions=4)
    facets, found = reduced(surface, BED, 0.03)
    assert found.triangles == surface.ntri
    assert found.elements == facets.ntri <= surface.ntri / 4
    assert found.error <= 0.03
    assert fresh_error(surface, facets, [0], DEPTHS) == pytest.approx(found.error)
    assert fresh_error(surface, facets, [1], HELD_BACK) == pytest.approx(found.held_back)
    assert fresh_error(surface, facets, [1001], HELD_BACK) < 0.06


def test_a_block_is_left_alone():
    """What is one block of triangles stays so: none is put together."""
    mesh = trimesh.creation.box((0.3, 0.2, 0.1))
    surface = make_surface(mesh.vertices, mesh.faces)
    facets, found = reduced(surface, BED, 0.01)
    assert surface.ntri <= BLOCK
    assert facets.ntri == found.elements == surface.ntri
    assert found.error == 0.0


def test_the_same_every_time():
    """Poses and motions are drawn from fixed seeds."""
    surface = rim(sections=96)
    pair = [reduced(surface, BED, 0.05)[0] for _ in range(2)]
    np.testing.assert_array_equal(pair[0].centres, pair[1].centres)


def sheet(*corners, max_edge):
    surface = Surface(np.array([corners], dtype=float))
    return surface.refined(max_edge)


def boxed(*extents, max_edge):
    mesh = trimesh.creation.box(extents)
    return make_surface(mesh.vertices, mesh.faces, allow_open=True).refined(max_edge)


ODD = {
    "one triangle": sheet((0, 0, 0), (1, 0, 0), (0, 1, 0), max_edge=10.0),
    "flat": sheet((0, 0, 0), (1, 0, 0), (0, 1, 0), max_edge=0.1),
    "sliver": sheet((0, 0, 0), (1e-3, 0, 0), (0, 0, 1), max_edge=0.05),
    "many in one place": Surface(np.repeat([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]], 100, axis=0)),
    "twelve": boxed(0.1, 0.1, 0.1, max_edge=1.0),
    "plate": boxed(0.2, 0.2, 1e-5, max_edge=0.02),
    "needle": boxed(1e-3, 1e-3, 0.05, max_edge=1e-3),
    "tiny": boxed(1e-4, 2e-4, 3e-4, max_edge=5e-5),
    "huge": boxed(50, 30, 20, max_edge=10.0),
    "far from its origin": boxed(0.1, 0.1, 0.1, max_edge=0.02).moved(np.eye(3), (1000.0, 0.0, 0.0)),
}


@pytest.mark.parametrize("law", ["rft3d", "rft2d", "drft3d", "drft2d"])
@pytest.mark.parametrize("name", ODD)
def test_odd_bodies(name, law):
    """Whatever the body and the law: the errors are within the bounds, or every triangle is kept."""
    surface = ODD[name]
    if law.startswith("drft"):
        surface = dataclasses.replace(surface, wheel=Wheel((0, 1, 0), (0, 0, 0), surface.size / 2))
    facets, found = reduced(surface, pack_bed(PRESETS["poppy-seeds"], get_law(law), FreeSurface(), (0, 1, 0)), 0.05)
    assert found.triangles == surface.ntri
    assert facets.ntri == found.elements <= surface.ntri
    assert found.error <= 0.05
    assert found.held_back <= 0.1
    assert np.isfinite(facets.triangles).all()
    assert facets.areas.sum() <= surface.areas.sum() * (1 + 1e-9)
    assert facets.size == surface.size
    assert facets.wheel == surface.wheel


def grousered_wheel():
    """Of [Agarwal] Table 4.1 with its grousers in full, 20,160 faces."""
    parameters = dataclasses.replace(wheels.GROUSER_WHEEL, arc=16, flank=4, top=4)
    return make_surface(*extruded(parameters.outline(False), parameters.width, rings=7, strips=5))


@pytest.mark.slow
@pytest.mark.parametrize(
    "surface",
    [grousered_wheel(), blob(np.random.default_rng(3), subdivisions=5)],
    ids=["grousered wheel", "blob"],
)
def test_a_tenth_of_twenty_thousand_faces(surface):
    """1 % with at least ten times fewer elements, and no more than 2 % in poses and motions never seen."""
    assert 20_000 < surface.ntri < 21_000
    facets, found = reduced(surface, BED, 0.01)
    fresh = fresh_error(surface, facets, range(1000, 1004), HELD_BACK)
    print(f"{found}, fresh {fresh:.4f}, closure {closure(facets):.1e}")
    assert found.elements <= surface.ntri / 10
    assert found.error <= 0.01
    assert fresh <= 0.02
    assert closure(facets) < 1e-12
