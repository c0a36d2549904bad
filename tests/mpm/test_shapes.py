"""Shapes: their measures, distances, and what cannot be one."""

import math

import matplotlib.image
import numpy as np
import pytest
import trimesh
from rftsim_mpm.errors import MpmError
from rftsim_mpm.shapes import box, disc, drum, extruded, mesh, polygon, wheel
from rftsim_mpm.silhouette import load_shape

ELL = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]])


@pytest.mark.parametrize(("shape", "content", "around"), [
    (box(2.0, 3.0), 6.0, 10.0),
    (box(1.0, 2.0, 3.0), 6.0, 22.0),
    (disc(1.0, 96), math.pi, 2.0 * math.pi),
    (polygon(ELL), 5.0, 12.0),
    (extruded(polygon(ELL), 2.0), 10.0, 34.0),
    (drum(1.0, 0.5), 0.5 * math.pi, 3.0 * math.pi),
])  # fmt: skip
def test_content_and_surface(shape, content, around):
    """Area and circumference, or volume and surface; normals close up to nothing."""
    assert shape.content == pytest.approx(content, rel=1e-3)
    assert shape.areas.sum() == pytest.approx(around, rel=1e-3)
    np.testing.assert_allclose(shape.normals.T @ shape.areas, 0.0, atol=1e-12)


def test_the_wheel_is_a_disc_with_lugs():
    """Area of Table 4.1's wheel: pi r^2 of the disc and 20 grousers of 12 x 6 mm, but for the arc's chords."""
    assert wheel(arc=40).content == pytest.approx(math.pi * 0.094**2 + 20 * 0.012 * 0.006, rel=2e-3)
    assert wheel().radius == pytest.approx(math.hypot(0.106, 0.003))


def test_distances_of_a_polygon():
    """An L: signed, and infinite where it is too far to matter."""
    points = np.array([[0.5, 2.0], [2.0, 0.25], [2.0, 2.0], [0.5, -0.4], [0.2, 1.5]])
    np.testing.assert_allclose(polygon(ELL).distances(points), [-0.5, -0.25, 1.0, np.inf, -0.2], atol=1e-12)


def test_distances_of_a_mesh_are_those_of_trimesh():
    """A ring, against an independent distance."""
    ring = trimesh.creation.annulus(0.5, 1.0, 0.6, sections=12)
    shape = mesh(np.array(ring.vertices), np.array(ring.faces))
    points = np.random.default_rng(0).uniform([-0.9, -0.9, -0.3], [0.9, 0.9, 0.3], (300, 3))
    _, expected, _ = trimesh.proximity.closest_point_naive(ring, points)
    found = shape.distances(points)
    np.testing.assert_allclose(np.abs(found), expected, atol=1e-12)
    radius = np.linalg.norm(points[:, :2], axis=1)
    assert (found[radius < 0.48] > 0.0).all()
    assert (found[(radius > 0.5) & (radius < 0.96)] < 0.0).all()


@pytest.mark.parametrize(("shape", "around"), [(box(2.0, 3.0), 6.0), (polygon(ELL), 8.0), (box(2.0, 3.0, 4.0), 22.0)])
def test_points_lie_all_over_the_surface_inside(shape, around):
    """On the surface half a metre inside, with their own face's normal; re-entrant corners are left open."""
    surface = shape.surface(0.1, 0.5 if shape.name == "plate" else 0.25)
    inset = 0.5 if shape.name == "plate" else 0.25
    np.testing.assert_allclose(shape.distances(surface.points), -inset, atol=1e-5)
    beyond = shape.distances(surface.points + 0.2 * surface.normals)
    np.testing.assert_allclose(beyond, 0.2 - inset, atol=0.1)
    assert surface.areas.sum() == pytest.approx(around if shape.name == "plate" else 10.0, rel=0.03)


def test_points_of_a_box_are_mirror_images():
    """So that half a plate is the half of a plate, to round-off; none lies in a plane of symmetry."""
    surface = box(2.0, 3.0, 0.4).surface(0.17)
    for axis in range(3):
        other = surface.points.copy()
        other[:, axis] *= -1.0
        assert np.abs(surface.points[:, axis]).min() > 1e-3
        a, b = (np.array(sorted(map(tuple, x.round(9) + 0.0))) for x in (surface.points, other))
        np.testing.assert_allclose(a, b, atol=1e-8)
    assert surface.areas.sum() == pytest.approx(2.0 * (2.0 * 3.0 + 5.0 * 0.4))


def test_a_picture_becomes_a_polygon(tmp_path):
    """A triangle drawn in a PNG has its own width, its area, and its three corners."""
    rows, columns = np.mgrid[0:200, 0:240]
    inside = (columns >= 20) & (rows < 180) & (rows > 20 + 0.8 * (columns - 20))
    path = tmp_path / "wedge.png"
    matplotlib.image.imsave(path, np.where(inside, 0.0, 1.0), cmap="gray", vmin=0.0, vmax=1.0)
    shape = load_shape(path, scale=0.2)
    assert np.ptp(shape.vertices[:, 0]) == pytest.approx(0.2)
    assert shape.content == pytest.approx(inside.sum() * (0.2 / np.ptp(columns[inside] + 1)) ** 2, rel=0.02)
    assert len(shape.vertices) < 12
    np.testing.assert_allclose(
        shape.vertices[np.argmax(shape.vertices[:, 1])][0], shape.vertices[:, 0].min(), atol=2e-3
    )


def test_pictures_that_are_no_silhouette(tmp_path):
    two, none = np.ones((40, 40)), np.ones((40, 40))
    two[5:10, 5:10] = two[20:30, 20:30] = 0.0
    for name, picture, said in (("two", two, "one figure"), ("none", none, "nothing dark")):
        path = tmp_path / f"{name}.png"
        matplotlib.image.imsave(path, picture, cmap="gray", vmin=0.0, vmax=1.0)
        with pytest.raises(MpmError, match=said):
            load_shape(path)
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(MpmError, match="cannot read a picture"):
        load_shape(tmp_path / "text.png")
    with pytest.raises(MpmError, match="no file"):
        load_shape(tmp_path / "absent.stl")


@pytest.mark.parametrize(
    ("points", "said"),
    [([[0, 0], [1, 0]], "three"), ([[0, 0], [1, 0], [2, 0]], "no area"), ([[0, 0], [0, 0], [1, 1]], "same place"),
     ([[0, 0], [2, 2], [2, 0], [0, 1]], "cross")],
)  # fmt: skip
def test_polygons_that_cannot_be(points, said):
    with pytest.raises(MpmError, match=said):
        polygon(np.array(points, float))
