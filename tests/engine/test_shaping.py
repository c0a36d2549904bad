"""Surfaces of bodies from their geoms: hulls as MuJoCo collides with them, and unions, so that nothing counts twice."""

import warnings

import mujoco
import numpy as np
import pytest
from trees import SAND, spec_of

from rftsim import RftsimNote, RftsimWarning, SceneError, SurfaceError, add_sand, surface_force
from rftsim.surface import solids
from rftsim.surface.triangles import Surface, make_surface
from rftsim.surface.union import overlapping, united

STAR = "0 0 0 .1 0 0 0 .1 0 0 0 .1 .02 .02 .02"
"""A tetrahedron whose slanted face is pressed in to a point: not convex."""
STAR_FACES = "0 2 1 0 1 3 0 3 2 1 2 4 2 3 4 3 1 4"


def bed_of(mjcf, option="", **options):
    return add_sand(spec_of(mjcf, option), SAND, **{"reduction": 0.0} | options)


def mesh_body(faces=STAR_FACES, **attributes):
    words = " ".join(f'{name}="{value}"' for name, value in attributes.items())
    asset = f'<asset><mesh name="m" vertex="{STAR}" face="{faces}" inertia="shell"/></asset>'
    return f'<body name="b"><freejoint/><geom type="mesh" mesh="m" mass=".1" {words}/></body>', asset


def volume(surface):
    return solids.volume(surface.triangles)


def box(size, at):
    return Surface(solids.box(np.array(size)) + np.array(at))


# Hulls ----------------------------------------------------------------------------------------------------------------


def test_a_colliding_mesh_is_its_hull():
    """MuJoCo collides with the hull, 0.1^3 / 6 of volume, and one line says so, and how much more it holds."""
    with pytest.warns(RftsimNote, match="1 mesh geom is felt as its convex hull, as MuJoCo collides.*'exact'"):
        bed = bed_of(*mesh_body())
    assert volume(bed.surfaces["b"]) == pytest.approx(0.1**3 / 6.0, rel=1e-6)
    assert len(bed.choices) == 1


def test_a_mesh_can_be_felt_as_it_is():
    """With meshes="exact", and where it collides with nothing, a closed mesh is felt itself: here 0.6 of its hull."""
    exact = bed_of(*mesh_body(), meshes="exact")
    seen = bed_of(*mesh_body(contype=0, conaffinity=0), geoms="all")
    for bed in (exact, seen):
        assert volume(bed.surfaces["b"]) == pytest.approx(0.6 * 0.1**3 / 6.0, rel=1e-6)
        assert bed.choices == ()


@pytest.mark.parametrize("meshes", ["hull", "exact"])
def test_open_meshes_are_their_hulls(meshes):
    """A mesh with a hole bounds nothing: its hull is felt, said once, without an option."""
    bed = bed_of(*mesh_body(STAR_FACES.rpartition(" 3 1 4")[0]), meshes=meshes)
    assert volume(bed.surfaces["b"]) == pytest.approx(0.1**3 / 6.0, rel=1e-6)
    assert "open" in bed.choices[0]
    assert len(bed.choices) == 1


def test_flat_meshes_are_left_out():
    """A mesh without a thickness has no hull: it is left out and said, with its remedy; alone, it is an error."""
    plate = "0 0 0 1 0 0 0 1 0 1 1 0"
    asset = f'<asset><mesh name="flat" vertex="{plate}" face="0 1 2 1 3 2" inertia="shell"/></asset>'
    flat = '<geom type="mesh" mesh="flat" mass="1" contype="0" conaffinity="0"/>'
    with pytest.warns(RftsimWarning, match="left out.*mesh flat is flat.*thickness"):
        assert bed_of(f'<body name="b"><freejoint/>{flat}<geom size=".1" contype="0" conaffinity="0"/></body>', asset)
    with pytest.raises(SceneError, match="no body would feel the sand"):
        bed_of(f'<body name="b"><freejoint/>{flat}</body>', asset)


def test_a_model_of_which_nothing_collides():
    """As gymnasium's Swimmer: what is seen is felt, and a line says so."""
    bed = bed_of('<body name="b"><freejoint/><geom size=".1" contype="0" conaffinity="0"/></body>')
    assert list(bed.surfaces) == ["b"]
    assert "no geom of a body that moves collides" in bed.choices[-1]


def test_one_line_for_many_meshes():
    """However many meshes there are, choices and doubts have a line for each kind."""
    mesh, asset = mesh_body(STAR_FACES.rpartition(" 3 1 4")[0])
    bodies = "".join(mesh.replace('name="b"', f'name="b{i}" pos="{i} 0 0"') for i in range(9))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        bed_of(bodies, asset)
    kinds = [one.category for one in told]
    assert kinds.count(RftsimNote) == 1
    assert kinds.count(RftsimWarning) <= 1


# Unions ---------------------------------------------------------------------------------------------------------------


def test_union_of_boxes():
    """Two cubes that share an eighth: volume 15/8, area 10.5 of 12, each part with its own; in either order."""
    one, other = box([1, 1, 1], [0, 0, 0]), box([1, 1, 1], [0.5, 0.5, 0.5])
    for pair in ([one, other], [other, one]):
        parts = united(pair)
        assert [part.areas.sum() for part in parts] == pytest.approx([5.25, 5.25], rel=1e-12)
        assert volume(parts[0]) + volume(parts[1]) == pytest.approx(15.0 / 8.0, rel=1e-12)
        assert np.abs((parts[0].normals * parts[0].areas[:, None]).sum(axis=0)).max() > 0.1, "each alone is open"


def test_what_lies_inside_is_gone():
    """A ball in a box has no surface; boxes that share a face lose it; those apart stay in groups of their own."""
    ball = Surface(0.2 * solids.ball(2))
    whole, nothing = united([box([1, 1, 1], [0, 0, 0]), ball])
    assert whole.areas.sum() == pytest.approx(6.0)
    assert nothing is None
    left, right = united([box([1, 1, 1], [0, 0, 0]), box([1, 1, 1], [1, 0, 0])])
    assert left.areas.sum() + right.areas.sum() == pytest.approx(10.0)
    boxes = [box([1, 1, 1], [x, 0, 0]) for x in (0.0, 5.0, 0.5, 5.5, 9.0)]
    assert sorted(overlapping(boxes)) == [[0, 2], [1, 3], [4]]


def test_what_is_no_solid_is_an_error():
    """A surface with a hole cannot be united."""
    with pytest.raises(SurfaceError, match="bounds no solid"):
        united([Surface(solids.box(np.ones(3))[:-1]), box([1, 1, 1], [0.5, 0, 0])])


def test_overlaps_of_a_foot_do_not_count_twice():
    """A shank that ends inside its foot: pushed straight down, the foot carries as much as it does alone."""
    foot = '<geom type="box" size=".05 .05 .03"/>'
    shank = '<geom type="capsule" fromto="0 0 0 0 0 .3" size=".02"/>'
    body = '<body name="b"><freejoint/>{}</body>'
    alone, both = (bed_of(body.format(geoms)) for geoms in (foot, foot + shank))
    forces = [
        surface_force(bed.surfaces["b"], SAND, position=(0, 0, -0.02), velocity=(0, 0, -0.1)).force[2]
        for bed in (alone, both)
    ]
    assert forces[1] == pytest.approx(forces[0], rel=1e-9)
    assert "united in 1 body" in both.choices[0]
    assert alone.choices == ()


def test_bodies_that_no_joint_parts_are_united():
    """A foot welded to its shank as a body of its own: together they carry what they would as one body."""
    foot, shank = '<geom type="box" size=".05 .05 .03"/>', '<geom type="capsule" fromto="0 0 0 0 0 .3" size=".02"/>'
    one = bed_of(f'<body name="a"><freejoint/>{foot}{shank}</body>')
    two = bed_of(f'<body name="a"><freejoint/>{shank}<body name="b" quat="1 0 0 1">{foot}</body></body>')
    area = sum(surface.areas.sum() for surface in two.surfaces.values())
    assert area == pytest.approx(one.surfaces["a"].areas.sum(), rel=1e-6)
    assert list(two.surfaces) == ["a", "b"]


def test_a_body_inside_another_feels_nothing():
    """A small body within a large one that it is fixed to says so."""
    bed = bed_of('<body name="a"><freejoint/><geom size=".1"/><body name="b"><geom size=".05"/></body></body>')
    assert list(bed.surfaces) == ["a"]
    assert bed.reasons["b"] == "lies inside bodies that it is fixed to, or has no geom with a surface"


def test_mujocos_hull_winds_outward():
    """The faces that MuJoCo keeps of a hull bound its volume, and are all supporting planes of the mesh."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(60, 3))
    words = " ".join(f"{x:.6f}" for x in points.ravel())
    asset = f'<asset><mesh name="m" vertex="{words}"/></asset>'
    surface = bed_of('<body name="b"><freejoint/><geom type="mesh" mesh="m"/></body>', asset).surfaces["b"]
    heights = surface.normals @ points.T - np.einsum("ij,ij->i", surface.normals, surface.centres)[:, None]
    assert heights.max() < 1e-5
    convex = asset.replace("/>", ' inertia="convex"/>')
    body = '<body name="b"><freejoint/><geom type="mesh" mesh="m" density="1"/></body>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{convex}<worldbody>{body}</worldbody></mujoco>")
    assert volume(surface) == pytest.approx(model.body("b").mass[0], rel=1e-5)
    assert make_surface(surface.triangles.reshape(-1, 3), np.arange(3 * surface.ntri).reshape(-1, 3)).notes == ()
