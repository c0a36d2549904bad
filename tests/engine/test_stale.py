"""What was changed after the sand was added, and what can have no sand: said once, or refused."""

import warnings

import mujoco
import numpy as np
import pytest
from trees import BALL, SAND, spec_of

from rftsim import FreeSurface, RftsimWarning, Sand, SceneError, add_sand, tractions, wrenches

FOOT = '<body name="foot" pos="0 0 .05"><freejoint/><geom name="sole" type="box" size=".1 .1 .05" mass="2"/></body>'
MOCAP = '<body name="tool" mocap="true"><geom size=".05"/>{}</body>'


def model_of(mjcf, option="", **options):
    spec = spec_of(mjcf, option)
    add_sand(spec, SAND, **{"reduction": 0.0} | options)
    return spec.compile()


def told(call):
    """The doubts that a call tells."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        call()
    return [str(one.message) for one in found if one.category is RftsimWarning]


def doubts_of(mjcf, option="", sand=SAND, **options):
    return told(lambda: add_sand(spec_of(mjcf, option), sand, reduction=0.0, **options))


# Stale geometry -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("field", ["geom_size", "geom_pos", "geom_quat", "geom_type", "geom_contype"])
def test_geoms_changed_in_place_are_said_once(field):
    """A geom that is resized, moved, turned, made another or uncoupled keeps its surface: one line, one time."""
    two = FOOT.replace("mass", 'quat=".9 .1 0 0" mass').replace("</body>", '<geom size=".1" pos="0 0 .2"/></body>')
    model = model_of(two + '<body><freejoint/><geom size=".1"/></body>')
    sole = model.geom("sole").id
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert told(lambda: wrenches(model, data)) == []
    if field == "geom_type":
        model.geom_type[sole] = mujoco.mjtGeom.mjGEOM_ELLIPSOID
    elif field == "geom_contype":
        model.geom_contype[sole] = model.geom_conaffinity[sole] = 0
    else:
        getattr(model, field)[sole, -1] += 0.001
    (doubt,) = told(lambda: wrenches(model, data))
    assert "geoms of foot were changed after the sand was added" in doubt
    assert told(lambda: (wrenches(model, data), tractions(model, data, "foot"))) == []


def test_geoms_changed_before_the_spec_is_compiled_are_said():
    """Domain randomisation of a spec after add_sand is seen in the model."""
    spec = spec_of(FOOT)
    add_sand(spec, SAND)
    spec.geom("sole").size[0] *= 1.1
    model = spec.compile()
    data = mujoco.MjData(model)
    (doubt,) = told(lambda: tractions(model, data, "foot"))
    assert "geoms of foot were changed" in doubt


def test_meshes_changed_in_place_are_said():
    """Vertices of a mesh, scaled in place."""
    corners = "1 1 1 1 1 -1 1 -1 1 1 -1 -1 -1 1 1 -1 1 -1 -1 -1 1 -1 -1 -1"
    asset = f'<asset><mesh name="m" scale=".1 .1 .1" vertex="{corners}"/></asset>'
    model = model_of('<body name="b"><freejoint/><geom type="mesh" mesh="m" mass="1"/></body>', asset)
    data = mujoco.MjData(model)
    assert told(lambda: wrenches(model, data)) == []
    model.mesh_vert *= 1.2
    assert len(told(lambda: wrenches(model, data))) == 1


def test_gravity_changed_in_place_is_said():
    """The sand's strength and level are those of the gravity at the load."""
    model = model_of(FOOT)
    data = mujoco.MjData(model)
    model.opt.gravity[2] = -1.62
    (doubt,) = told(lambda: wrenches(model, data))
    assert "gravity was changed after the sand was added" in doubt


def test_what_may_change_is_followed():
    """Twice the mass and another place of the body: nothing is said, and the sand carries the new weight."""
    model = model_of(FOOT, draw=False)
    model.body_mass[1] *= 2.0
    model.body_inertia[1] *= 2.0
    model.body_pos[1, 0] += 0.3
    data = mujoco.MjData(model)
    while data.time < 1.0:
        mujoco.mj_step(model, data)
    assert told(lambda: wrenches(model, data)) == []
    assert wrenches(model, data).force[1, 2] == pytest.approx(4.0 * 9.81, rel=0.01)


def test_attached_and_saved_models_are_as_they_were(tmp_path):
    """A prefix, a turned frame and a text file with six digits are no changes."""
    child = spec_of(FOOT)
    add_sand(child, SAND)
    parent = mujoco.MjSpec()
    parent.attach(child, prefix="a-", frame=parent.worldbody.add_frame(pos=[1, 0, 0], quat=[1, 0, 0, 1]))
    path = tmp_path / "whole.xml"
    attached = parent.compile()
    path.write_text(parent.to_xml())
    for model in (attached, mujoco.MjModel.from_xml_path(str(path))):
        data = mujoco.MjData(model)
        assert told(lambda m=model, d=data: wrenches(m, d)) == []


# Mocap bodies ---------------------------------------------------------------------------------------------------------


def test_mocap_bodies_are_left_out_and_said():
    """MuJoCo gives them no velocity, nor what hangs on them: a line says so, with the remedy."""
    finger = '<body name="finger"><joint/><geom size=".03" pos="0 0 .2" mass="1"/></body>'
    (doubt,) = doubts_of(MOCAP.format(finger) + BALL)
    assert "no sand acts on tool, finger, as MuJoCo gives a mocap body" in doubt
    assert "weld" in doubt


def test_mocap_bodies_alone_or_by_name_are_refused():
    """Where nothing else would feel the sand, and where one is asked for, that is an error."""
    for options in ({}, {"bodies": ["tool"]}):
        with pytest.raises(SceneError, match="hangs on a mocap body, to which MuJoCo gives no velocity"):
            model_of(MOCAP.format(""), **options)


def test_mocap_markers_are_not_worth_a_word():
    """A target that collides with nothing."""
    marker = MOCAP.format("").replace("size", 'contype="0" conaffinity="0" size')
    assert doubts_of(marker + FOOT) == []


def test_a_free_body_welded_to_a_mocap_body_feels_the_sand():
    """The remedy: pushed down by the weld, it resists."""
    hand = '<body name="hand" mocap="true" pos="0 0 .05"/>'
    spec = spec_of(hand + FOOT, extra='<equality><weld body1="hand" body2="foot"/></equality>')
    add_sand(spec, SAND, reduction=0.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    while data.time < 0.2:
        data.mocap_pos[0, 2] -= 0.05 * model.opt.timestep
        mujoco.mj_step(model, data)
    assert wrenches(model, data).force[model.body("foot").id, 2] > 20.0


# Gravity and slopes ---------------------------------------------------------------------------------------------------


def test_sand_beyond_its_angle_of_repose_is_said():
    """35 degrees, where a sand of mu 0.5 lies at 26.6; one of mu 0.8 lies there."""
    slope = FreeSurface(normal=(np.sin(np.radians(35)), 0.0, np.cos(np.radians(35))))
    steep = doubts_of(BALL, sand=Sand(rho_c=1500, mu_int=0.5, mu_surf=0.4), terrain=slope)
    assert any(
        "tilted by 35 degrees against gravity, beyond its angle of repose of 26.6 (mu_int 0.5)" in s for s in steep
    )
    flat = doubts_of(BALL, sand=Sand(rho_c=1500, mu_int=0.8, mu_surf=0.4), terrain=slope)
    assert not any("repose" in s for s in flat)


@pytest.mark.parametrize(
    ("gravity", "words"),
    [
        (
            "1.7036 0 -9.6611",
            "gravity points 10 degrees away from -z, so that the sand lies as on a slope of 10 degrees",
        ),
        ("0 -9.81 0", "tilted by 90 degrees against gravity"),
        ("0 0 9.81", "tilted by 180 degrees against gravity"),
        ("0 0 -9.81", None),
        ("0 0 0", "the model has no gravity"),
    ],
)
def test_gravity_that_is_not_along_z_is_said(gravity, words):
    found = [s for s in doubts_of(BALL, f'<option gravity="{gravity}"/>') if "carry" not in s]
    assert found == [] if words is None else any(words in s for s in found)


def test_gravity_against_a_tilted_surface_is_level_sand():
    """Sand whose normal is against a tilted gravity is level to it: there is no doubt."""
    normal = np.array([-1.7036, 0.0, 9.6611]) / 9.81
    assert doubts_of(BALL, '<option gravity="1.7036 0 -9.6611"/>', terrain=FreeSurface(normal=tuple(normal))) == []
