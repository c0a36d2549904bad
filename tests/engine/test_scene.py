"""What `add_sand` and `load` promise: which bodies feel the sand, and what is refused or warned of."""

import re

import numpy as np
import pytest
from trees import BALL, SAND, sandy, shaken, spec_of, xml

from rftsim import RftsimWarning, SceneError, add_sand, instances, load, wrenches

FLOOR = '<geom name="floor" type="plane" size="5 5 .1"/>'
CAST = (
    BALL
    + """
  <body name="fixed"><geom size=".1"/><body name="arm" pos="0 0 1"><joint/><geom size=".1"/></body></body>
  <body name="ghost" pos="1 0 0"><joint/><geom size=".1" contype="0" conaffinity="0"/></body>
  <body name="frame" pos="2 0 0"><joint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <body name="shell" pos="0 0 .1"><geom size=".1"/></body>
  </body>"""
)


def bed_of(mjcf, option="", sand=SAND, law="rft3d", **options):
    return add_sand(spec_of(mjcf, option), sand, law, **{"reduction": 0.0} | options)


# Which bodies ---------------------------------------------------------------------------------------------------------


def test_bodies_that_move_and_collide_feel_the_sand():
    """By default each body that can move and has geoms that collide; each body has a reason."""
    bed = bed_of(CAST)
    assert list(bed.surfaces) == ["ball", "arm", "shell"]
    assert {name: bed.reasons[name] for name in bed.reasons if name not in bed.surfaces} == {
        "fixed": "cannot move",
        "ghost": "has no geom that collides",
        "frame": "has no geom",
    }
    assert bed.reasons["ball"] == f"moves, {bed.surfaces['ball'].ntri} triangles"


def test_visual_geoms_on_request():
    """geoms="all" takes geoms that do not collide where a body has no others, and none beside those that do."""
    assert "ghost" in bed_of(CAST, geoms="all").surfaces
    cloak = BALL.replace("</body>", '<geom type="box" size=".05 .05 .05" contype="0" conaffinity="0"/></body>')
    assert bed_of(cloak, geoms="all").surfaces["ball"].ntri == bed_of(BALL).surfaces["ball"].ntri


def test_chosen_bodies():
    """Only the bodies asked for, and the others say so."""
    bed = bed_of(CAST, bodies=["arm"])
    assert list(bed.surfaces) == ["arm"]
    assert bed.reasons["ball"] == "not among the bodies asked for"


@pytest.mark.parametrize(
    ("bodies", "words"),
    [
        (["bal"], "no body 'bal'; near are ball"),
        (["fixed"], "'fixed' cannot feel the sand: it cannot move"),
        (["ball", "ghost"], "'ghost' cannot feel the sand: it has no geom that collides"),
        ([], "no body would feel the sand"),
    ],
)
def test_bodies_that_cannot(bodies, words):
    """A body asked for by a wrong name, or that cannot feel the sand, is an error that says which and why."""
    with pytest.raises(SceneError, match=re.escape(words)):
        bed_of(CAST, bodies=bodies)


def test_unnamed_bodies_get_names():
    """A body without a name gets one that is not taken."""
    bed = bed_of(BALL.replace(' name="ball"', "") + BALL.replace('"ball" pos="0', '"body2" pos="5') + "<body/>")
    assert list(bed.surfaces) == ["body1", "body2"]
    assert len(bed.reasons) == 3


def test_discarded_visuals_are_named_as_the_cause():
    """Where <compiler discardvisual> took every geom, the error names the flag."""
    with pytest.raises(SceneError, match="discardvisual"):
        bed_of(
            BALL.replace('size=".1"', 'size=".1" contype="0" conaffinity="0" mass="1"'),
            '<compiler discardvisual="true"/>',
        )


def test_body_with_another_plugin():
    """A body that has sand keeps it; a second bed takes the others, and its own name is needed."""
    spec = spec_of(CAST)
    add_sand(spec, SAND, bodies=["ball"])
    with pytest.raises(SceneError, match="give this bed another name"):
        add_sand(spec, SAND)
    bed = add_sand(spec, SAND, name="second", reduction=0.0)
    assert list(bed.surfaces) == ["arm", "shell"]
    assert bed.reasons["ball"] == "has another plugin, or sand already"


# Flags ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ('<option><flag spring="disable" damper="disable"/></option>', "skips all passive forces"),
        ('<option><flag sleep="enable"/></option>', "sleep"),
    ],
)
def test_flags_under_which_sand_would_fail(option, words):
    """Flags that would skip the sand, or pile it up, are refused by name."""
    with pytest.raises(SceneError, match=words):
        bed_of(BALL, option)


@pytest.mark.parametrize("flag", ["spring", "damper"])
def test_one_passive_flag_is_no_matter(flag):
    """With springs or dampers alone disabled, the sand acts."""
    model = sandy(option=f'<option><flag {flag}="disable"/></option>')
    assert np.abs(shaken(model).qfrc_passive).max() > 1.0


def test_gravity_that_differs_from_the_sands():
    """Sand measured under another gravity is warned of, with the remedy; the remedy silences it."""
    moon = '<option gravity="0 0 -1.62"/>'
    with pytest.warns(RftsimWarning, match=r"1\.62 m/s\^2 .* pass sand\.replace\(g=1\.62\)"):
        bed_of(BALL, moon)
    bed_of(BALL, moon, SAND.replace(g=1.62))


# Loading --------------------------------------------------------------------------------------------------------------


def test_load_from_xml_file_and_path(tmp_path):
    """`load` takes XML, a path, or the path as text."""
    path = tmp_path / "ball.xml"
    path.write_text(xml(BALL))
    forces = [wrenches(m, shaken(m)).force for m in (load(source, SAND) for source in (xml(BALL), path, str(path)))]
    assert forces[0].any()
    np.testing.assert_array_equal(forces, forces[:1] * 3)


def test_load_urdf(tmp_path):
    """A URDF's links feel the sand."""
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    link = '<link name="{}"><inertial><mass value="1"/>' + inertia + "</inertial>{}</link>"
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    joint = '<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>'
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="r">{link.format("base", "")}{link.format("arm", ball)}{joint}</robot>')
    model = load(path, SAND)
    assert [model.body(i).name for i in instances(model)[0].bodies] == ["arm"]


def test_load_missing_file():
    """A missing file is named."""
    with pytest.raises(SceneError, match=r"no model file nowhere\.xml"):
        load("nowhere.xml", SAND)


@pytest.mark.parametrize(
    "options",
    [
        pytest.param({"bodies": ["nobody"]}, id="bodies"),
        pytest.param({"wheels": ["nobody"], "law": "drft3d"}, id="wheels"),
        pytest.param({"max_edge": -1.0}, id="max_edge"),
        pytest.param({"sand": "no such sand"}, id="sand"),
        pytest.param({"law": "no such law"}, id="law"),
    ],
)
def test_a_spec_on_which_add_sand_raised_is_unchanged(options):
    """Where add_sand raises, the spec is as it was."""
    spec = spec_of(FLOOR + BALL + "<body/>")
    before = spec.to_xml()
    with pytest.raises(ValueError, match=r"nobody|no such|-1"):
        add_sand(spec, **{"sand": SAND} | options)
    assert spec.to_xml() == before


def test_a_spec_whose_bed_has_no_name_of_its_own_is_unchanged():
    """... even where floors were to be disabled and the bed's name is taken."""
    spec = spec_of(FLOOR + BALL + BALL.replace("ball", "other"))
    add_sand(spec, SAND, bodies=["ball"], terrain=9.0)
    before = spec.to_xml()
    with pytest.raises(SceneError, match="another name"):
        add_sand(spec, SAND)
    assert spec.to_xml() == before


def test_geoms_that_others_name():
    """Sensors and contact pairs may name geoms."""
    ball = (
        '<body name="ball" pos="0 0 .02"><freejoint/><geom name="g" size=".1"/><geom size=".02" pos="0 0 .2"/></body>'
    )
    more = '<sensor><framepos objtype="geom" objname="g"/></sensor><contact><pair geom1="g" geom2="f"/></contact>'
    floor = '<geom name="f" type="plane" size="1 1 .1"/>'
    model = load(f"<mujoco><worldbody>{floor}{ball}</worldbody>{more}</mujoco>", SAND)
    assert model.geom("g").id >= 0
    assert model.geom("f").contype == 0
