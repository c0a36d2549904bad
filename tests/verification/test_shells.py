"""Shells of one mesh that overlap or touch: what is felt is the surface of their union, in whatever order they come."""

import time

import manifold3d
import numpy as np
import pytest
import trimesh
from shapes import about

from rftsim import Sand, make_surface, surface_force
from rftsim.surface import solids

SAND = Sand(xi_n=1e6, mu_surf=0.4)
RADIUS, WIDTH, SECTIONS = 0.1, 0.06, 48
LUGS, HEIGHT, THICK = 12, 0.02, 0.008
FLAT = RADIUS * np.cos(np.pi / SECTIONS)
"""Distance of the rim's flats from the axis."""


def box(low, high):
    return solids.box(np.subtract(high, low)) + np.add(low, high) / 2


def surface_of(shells, order=None, **options):
    """The surface of a triangle soup, its faces in an order drawn from a seed."""
    soup = np.concatenate(shells)
    if order is not None:
        soup = soup[np.random.default_rng(order).permutation(len(soup))]
    return make_surface(soup.reshape(-1, 3), np.arange(3 * len(soup)).reshape(-1, 3), **options)


def measured(surface):
    return surface.areas.sum(), solids.volume(surface.triangles)


def closure(surface):
    return np.abs(surface.normals.T @ surface.areas).max() / surface.areas.sum()


def wheel(sunk):
    """A rim, its axis along z, and lugs each in the middle of a flat, sunk in by a length."""
    rim = trimesh.creation.cylinder(radius=RADIUS, height=WIDTH, sections=SECTIONS).triangles
    lug = box((FLAT - sunk, -THICK / 2, -WIDTH / 2), (FLAT - sunk + HEIGHT, THICK / 2, WIDTH / 2))
    return [rim, *(lug @ about((0, 0, 1), np.pi / SECTIONS + 2 * np.pi * k / LUGS).T for k in range(LUGS))]


def outline(sunk):
    """The same wheel as one polygon, pulled along z."""
    angle = 2 * np.pi * np.arange(SECTIONS) / SECTIONS
    parts = [RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])]
    lug = np.array([(0.9 * FLAT, -1), (FLAT - sunk + HEIGHT, -1), (FLAT - sunk + HEIGHT, 1), (0.9 * FLAT, 1)])
    lug[:, 1] *= THICK / 2
    turns = [about((0, 0, 1), np.pi / SECTIONS + 2 * np.pi * k / LUGS)[:2, :2] for k in range(LUGS)]
    polygon = manifold3d.CrossSection(parts + [lug @ turn.T for turn in turns], manifold3d.FillRule.NonZero)
    mesh = polygon.extrude(WIDTH).translate([0, 0, -WIDTH / 2]).to_mesh64()
    return make_surface(np.asarray(mesh.vert_properties), np.asarray(mesh.tri_verts).astype(int))


@pytest.mark.parametrize("order", [None, 0, 1])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("sunk", [0.003, 0.0, 1e-7])
def test_lugs_on_a_rim(sunk, single, turned, order):
    """Twelve lugs sunk in a rim, or flush with it, in single precision too, have area and volume of the one polygon."""
    turn = about((1, 0.3, 0.2), 0.7) if turned else np.eye(3)
    shells = [shell @ turn.T for shell in wheel(sunk)]
    if single:
        shells = [shell.astype(np.float32).astype(float) for shell in shells]
    surface = surface_of(shells, order)
    assert measured(surface) == pytest.approx(measured(outline(sunk)), rel=1e-5)
    assert closure(surface) < 1e-12
    assert surface.notes == ("mesh: of 13 shells that overlap others only what lies outside them is felt",)


@pytest.mark.parametrize("sunk", [0.003, 0.0])
def test_force_on_lugs(sunk):
    """What the wheel feels is what the one polygon feels, both as fine; without its lugs it would feel much less."""
    motion = {"position": (0, 0, -0.05), "velocity": (0.05, 0, -0.02), "angular_velocity": (0, 1.0, 0)}
    lying = {"rotation": about((1, 0, 0), np.pi / 2), **motion}
    (force, moment), (whole, turning), (bare, _) = (
        surface_force(surface.refined(0.004), SAND, **lying)[:2]
        for surface in (surface_of(wheel(sunk), 3), outline(sunk), surface_of(wheel(sunk)[:1]))
    )
    np.testing.assert_allclose(force, whole, rtol=0, atol=2e-3 * np.abs(whole).max())
    np.testing.assert_allclose(moment, turning, rtol=0, atol=2e-3 * np.abs(turning).max())
    assert np.linalg.norm(bare - whole) > 0.2 * np.linalg.norm(whole)


@pytest.mark.parametrize("order", range(4))
def test_boxes_that_half_overlap(order):
    """1 x 1 x 1 twice, moved by (0.5, 0.3, 0.2): 2 - 0.28 of volume, 12 - 2.62 of area, whichever comes first."""
    one, other = box((0, 0, 0), (1, 1, 1)), box((0.5, 0.3, 0.2), (1.5, 1.3, 1.2))
    for shells in ([one, other], [other, one]):
        assert measured(surface_of(shells, order)) == pytest.approx((9.38, 1.72), rel=1e-12)


@pytest.mark.parametrize("seed", range(40))
def test_blocks_that_touch(seed):
    """Boxes on a lattice, which share faces, parts of them, edges, corners, or everything: counted cell by cell.

    Every other case is turned, every third in single precision; in half of them some boxes are inside out.
    """
    rng = np.random.default_rng(seed)
    low = rng.integers(0, 3, (rng.integers(2, 8), 3))
    high = low + (rng.integers(1, 3, low.shape) if seed % 4 < 2 else 1)
    filled = np.zeros((7, 7, 7), dtype=int)
    shells = []
    for a, b in zip(low, high, strict=True):
        filled[a[0] + 1 : b[0] + 1, a[1] + 1 : b[1] + 1, a[2] + 1 : b[2] + 1] = 1
        inward = seed % 4 > 1 and rng.random() < 0.3
        shells.append(box(a, b)[:, :: -1 if inward else 1])
    expected = sum(np.abs(np.diff(filled, axis=k)).sum() for k in range(3)), filled.sum()
    turn = about((0.2, 0.5, 1), rng.uniform(0, 6)) if seed % 2 else np.eye(3)
    shells = [0.01 * shell @ turn.T for shell in shells]
    if seed % 3 == 0:
        shells = [shell.astype(np.float32).astype(float) for shell in shells]
    area, volume = measured(surface_of(shells, seed))
    assert (area / 1e-4, volume / 1e-6) == pytest.approx(expected, rel=2e-5)


def test_what_is_shown_whole_keeps_its_triangles():
    """A ball in the hole of a ring overlaps its box only: nothing is changed, and nothing said."""
    ring, ball = trimesh.creation.torus(0.2, 0.05), trimesh.creation.icosphere(radius=0.04)
    surface = surface_of([ring.triangles, ball.triangles])
    assert surface.notes == ()
    assert surface.ntri == len(ring.faces) + len(ball.faces)


def test_fineness_stays():
    """Of a finely meshed box half in another the triangles outside keep their size."""
    fine = trimesh.creation.box((1, 1, 1)).subdivide_to_size(0.1).triangles
    surface = surface_of([fine, box((0.2, -2, -2), (4, 2, 2))])
    own = surface.centres[:, 0] < 0.19
    assert np.count_nonzero(own) > 0.5 * len(fine)
    edges = np.linalg.norm(np.diff(surface.triangles[own], axis=1), axis=2)
    assert edges.max() <= 0.1 + 1e-9


def test_many_shells_take_time_in_proportion():
    """1600 shells, a tenth of which overlap, take less than ten times as long as 400; in pairs they would take 16."""
    spent = []
    for count in (400, 1600):
        rng = np.random.default_rng(0)
        shells = [0.02 * solids.ball(0) + rng.uniform(0, count ** (1 / 3) / 4, 3) for _ in range(count)]
        start = time.process_time()
        surface_of(shells)
        spent.append(time.process_time() - start)
    assert spent[1] < 10 * spent[0]


def test_soups_are_judged_at_once():
    """Of 20,000 triangles without neighbours the first is named as open; where that is allowed, all are felt."""
    soup = np.random.default_rng(0).uniform(0, 1, (20000, 3, 3))
    assert surface_of([soup], allow_open=True).ntri == 20000
