"""Meshes: what is repaired, refused and noted on the way to a surface that bounds a body."""

import dataclasses

import numpy as np
import pytest
import trimesh
from shapes import rotation

from rftsim import Sand, Surface, SurfaceError, load_surface, make_surface, surface_force
from rftsim.surface.triangles import Wheel

CUBE = trimesh.creation.box((0.2, 0.3, 0.4))


def surface_of(*meshes, **options):
    whole = trimesh.util.concatenate(meshes)
    return make_surface(whole.vertices, whole.faces, **options)


def volume(surface):
    """Sum of c . n A / 3, the divergence theorem."""
    return float(np.einsum("ij,ij,i->", surface.centres, surface.normals, surface.areas) / 3.0)


def closure(surface):
    """Sum of n A, zero where closed."""
    return np.abs(surface.normals.T @ surface.areas).max()


def inverted(mesh):
    mesh = mesh.copy()
    mesh.invert()
    return mesh


# What bounds a body ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "mesh",
    [
        CUBE,
        trimesh.creation.icosphere(radius=0.1),
        trimesh.creation.torus(0.2, 0.05),
        trimesh.creation.capsule(0.3, 0.1),
    ],
    ids=["box", "sphere", "torus", "capsule"],
)
@pytest.mark.parametrize("inward", [False, True])
def test_closed_meshes_face_outward(mesh, inward):
    """sum n A = 0 and sum c . n A / 3 = volume, whichever way the mesh was wound."""
    surface = surface_of(inverted(mesh) if inward else mesh)
    assert closure(surface) < 1e-12
    assert volume(surface) == pytest.approx(mesh.volume, rel=1e-9)
    assert surface.notes == ((f"mesh: turned {len(mesh.faces)} of {len(mesh.faces)} faces outward",) if inward else ())


def test_inconsistent_winding_is_turned():
    """Faces wound against their neighbours are turned, and counted."""
    faces = CUBE.faces.copy()
    faces[[1, 5, 7]] = faces[[1, 5, 7], ::-1]
    surface = make_surface(CUBE.vertices, faces, name="box")
    assert volume(surface) == pytest.approx(CUBE.volume)
    assert surface.notes == ("box: turned 3 of 12 faces outward",)


def test_several_shells():
    """Disjoint bodies in one mesh, one of them inward: both face outward."""
    other = inverted(CUBE.copy().apply_translation((1, 0, 0)))
    surface = surface_of(CUBE, other)
    assert volume(surface) == pytest.approx(2 * CUBE.volume)
    assert closure(surface) < 1e-12


def test_cavity_is_left_out():
    """Sand does not reach a closed cavity, so its walls are not part of the surface, and that is said."""
    hollow = surface_of(CUBE, inverted(CUBE.copy().apply_scale(0.5)))
    assert volume(hollow) == pytest.approx(CUBE.volume)
    assert "12 faces of shells inside another" in hollow.notes[0]


def test_no_sand_in_a_cavity():
    """A hollow body feels what a solid one does: sand does not reach a closed cavity."""
    hollow, solid = surface_of(CUBE, inverted(CUBE.copy().apply_scale(0.5))), surface_of(CUBE)
    motion = {"position": (0, 0, -1), "velocity": (0.3, 0, -1)}
    forces = [surface_force(surface, Sand(xi_n=1.0), **motion).force for surface in (hollow, solid)]
    np.testing.assert_allclose(*forces, rtol=1e-9)


def test_a_shell_in_the_hole_of_a_ring_is_no_cavity():
    """A ball in the hole of a torus is beside it, not in it."""
    ring, ball = trimesh.creation.torus(0.2, 0.05), trimesh.creation.icosphere(radius=0.04)
    assert volume(surface_of(ring, inverted(ball))) == pytest.approx(ring.volume + ball.volume)


def test_unmerged_vertices_are_merged():
    """A triangle soup, as an STL holds, is closed where its corners meet."""
    soup = CUBE.triangles.reshape(-1, 3)
    assert volume(make_surface(soup, np.arange(36).reshape(-1, 3))) == pytest.approx(CUBE.volume)


# What is dropped and refused ------------------------------------------------------------------------------------------


def test_repeated_faces_are_dropped():
    """A face that is there twice, either way round, counts once."""
    surface = make_surface(CUBE.vertices, [*CUBE.faces, CUBE.faces[0], CUBE.faces[3][::-1]], name="box")
    assert volume(surface) == pytest.approx(CUBE.volume)
    assert surface.notes == ("box: dropped 2 repeated faces",)


def test_faces_of_no_area_are_dropped():
    """Slivers without an area have no normal; what remains is checked for closure."""
    vertices = np.vstack([CUBE.vertices, CUBE.vertices[CUBE.faces[0]].mean(axis=0)])
    surface = make_surface(vertices, [*CUBE.faces, (0, 0, 1), (8, 8, 8)], name="box")
    assert surface.ntri == 12
    assert "dropped 2 faces of no area" in surface.notes[0]
    assert np.isfinite(surface.normals).all()


def test_open_mesh():
    """An open mesh is refused, with the mesh, a face at the hole and its place; or noted where allowed."""
    with pytest.raises(SurfaceError, match=r"bowl is open at face \d+ of 11, near \(.*\): close it, or allow open"):
        make_surface(CUBE.vertices, CUBE.faces[:-1], name="bowl")
    surface = make_surface(CUBE.vertices, CUBE.faces[:-1], name="bowl", allow_open=True)
    assert surface.ntri == 11
    assert "open" in surface.notes[0]


@pytest.mark.parametrize(
    ("vertices", "faces", "words"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3)), "thing has no faces"),
        (CUBE.vertices, np.zeros((0, 3)), "thing has no faces"),
        (np.zeros((3, 3)), [(0, 1, 2)], "thing has no face with an area"),
        (
            np.where(np.arange(24).reshape(8, 3) == 4, np.nan, CUBE.vertices),
            CUBE.faces,
            "face . has a vertex that is not",
        ),
        (
            np.where(np.arange(24).reshape(8, 3) == 4, np.inf, CUBE.vertices),
            CUBE.faces,
            "face . has a vertex that is not",
        ),
        (CUBE.vertices, [*CUBE.faces, (0, 1, 8)], "refers to vertex 8; vertices are 0 to 7"),
        (CUBE.vertices, [*CUBE.faces, (0, 1, -1)], "refers to vertex"),
    ],
    ids=["empty", "no faces", "a point", "NaN", "infinite", "beyond the vertices", "before the vertices"],
)
def test_meshes_that_bound_nothing(vertices, faces, words):
    """Each names the mesh and what is wrong."""
    with pytest.raises(SurfaceError, match=words):
        make_surface(vertices, faces, name="thing")


@pytest.mark.parametrize(("scale", "words"), [(1000, "needs scale 0.001"), (1e-3, "lengths are in metres"), (1, None)])
def test_suspicious_sizes_are_noted(scale, words):
    """A body of 400 m is a mesh in millimetres."""
    notes = make_surface(CUBE.vertices * scale, CUBE.faces).notes
    assert notes == () if words is None else words in notes[0]


# Refinement and motion ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("edge", [1.0, 0.1, 0.03])
def test_refinement_keeps_the_body(edge):
    """Splitting keeps area, volume and closure, and no edge exceeds the limit."""
    surface = dataclasses.replace(surface_of(CUBE), edge_on=1e-6, wheel=Wheel((0, 1, 0), (0, 0, 0), 0.1), notes=("a",))
    fine = surface.refined(edge)
    edges = np.linalg.norm(fine.triangles - np.roll(fine.triangles, 1, axis=1), axis=2)
    assert edges.max() <= edge
    assert fine.areas.sum() == pytest.approx(CUBE.area)
    assert volume(fine) == pytest.approx(CUBE.volume)
    assert (fine.edge_on, fine.wheel, fine.notes) == (1e-6, surface.wheel, ("a",))
    assert (fine.ntri == surface.ntri) == (edge == 1.0)


def test_refinement_needs_a_length():
    """max_edge must be positive."""
    with pytest.raises(ValueError, match="max_edge must be positive, not 0"):
        surface_of(CUBE).refined(0.0)


@pytest.mark.parametrize("size", [1, 7, 64, 10000])
def test_clustering_only_reorders(size):
    """Each `size` triangles in turn lie close together, and they are the same triangles."""
    order = np.random.default_rng(0).permutation(1280)
    surface = Surface(trimesh.creation.icosphere(subdivisions=3).triangles[order])
    close = surface.clustered(size)
    rows = [{triangle.tobytes() for triangle in s.triangles} for s in (close, surface)]
    assert rows[0] == rows[1]
    assert close.ntri == len(rows[0]) == 1280
    extents = [np.ptp(close.centres[k : k + size], axis=0).max() for k in range(0, 1280, size)]
    assert size > 64 or max(extents) < 0.7 * np.ptp(surface.centres, axis=0).max()


def test_moved():
    """x -> R x + t moves centres and turns normals."""
    r, t = rotation(np.random.default_rng(1)), np.array([1.0, 2.0, 3.0])
    surface = surface_of(CUBE)
    moved = surface.moved(r, t)
    np.testing.assert_allclose(moved.centres, surface.centres @ r.T + t, atol=1e-14)
    np.testing.assert_allclose(moved.normals, surface.normals @ r.T, atol=1e-14)


def test_moved_takes_the_wheel_along():
    """A wheel's axis and centre move with its surface."""
    r, t = rotation(np.random.default_rng(1)), np.array([1.0, 2.0, 3.0])
    wheel = dataclasses.replace(surface_of(CUBE), wheel=Wheel((0, 1, 0), (0.1, 0, 0), 0.1)).moved(r, t).wheel
    np.testing.assert_allclose(wheel.axis, r @ [0, 1, 0], atol=1e-14)
    np.testing.assert_allclose(wheel.centre, r @ [0.1, 0, 0] + t, atol=1e-14)


@pytest.mark.parametrize(("axis", "radius"), [((0, 0, 0), 1.0), ((0, 1, 0), 0.0), ((0, 1, 0), -1.0)])
def test_wheels_that_cannot_be(axis, radius):
    """A wheel needs an axis and a positive radius."""
    with pytest.raises(ValueError, match="needs an axis and a positive radius"):
        Wheel(axis, (0, 0, 0), radius)
    assert Wheel((0, 2, 0), (0, 0, 0), 1.0).axis == (0, 1, 0)


# Files ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "exact"), [("stl", 1e-6), ("obj", 1e-6), ("ply", 1e-6), ("off", 1e-6)])
def test_files(tmp_path, kind, exact):
    """What trimesh writes comes back, in metres or scaled."""
    path = tmp_path / f"box.{kind}"
    CUBE.export(path)
    surface = load_surface(path)
    assert (surface.ntri, surface.notes) == (12, ())
    assert volume(surface) == pytest.approx(CUBE.volume, rel=exact)
    assert volume(load_surface(str(path), scale=0.5)) == pytest.approx(CUBE.volume / 8, rel=exact)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_scales_that_cannot_be(tmp_path, scale):
    """The scale must be positive."""
    path = tmp_path / "box.stl"
    CUBE.export(path)
    with pytest.raises(SurfaceError, match="scale must be positive"):
        load_surface(path, scale=scale)


def test_missing_file(tmp_path):
    """A missing file, or a folder, is named."""
    for path in (tmp_path / "no.stl", tmp_path):
        with pytest.raises(SurfaceError, match="no mesh file"):
            load_surface(path)


@pytest.mark.parametrize("name", ["a.stl", "a.obj", "a.ply", "a.off", "a.glb", "a.txt", "a"])
@pytest.mark.parametrize(
    "content", [b"", b"hello world\n", bytes(range(256)) * 20, b"\x00" * 200], ids=["empty", "text", "bytes", "zeros"]
)
def test_files_that_are_no_mesh(tmp_path, name, content):
    """Whatever is wrong with a file, the error is a SurfaceError that names it."""
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(SurfaceError, match=rf"{name}\b"):
        load_surface(path)


def test_surface_measures():
    """Centroid, normal and area of a triangle; its size is the largest extent."""
    surface = Surface(np.array([[[0, 0, 0], [3, 0, 0], [0, 4, 0]]], dtype=float))
    np.testing.assert_allclose(surface.centres, [[1, 4 / 3, 0]])
    np.testing.assert_allclose(surface.normals, [[0, 0, 1]])
    assert (surface.areas[0], surface.ntri, surface.size) == (6.0, 1, 4.0)
