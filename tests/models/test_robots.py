"""The robots: what they weigh, that they are closed and symmetric, stand on sand, and walk or roll forward."""

import dataclasses

import mujoco
import numpy as np
import pytest
import trimesh
from rftsim_models import parts
from rftsim_models.hexapod import HEXAPOD, TRIPODS, build_hexapod
from rftsim_models.hopper import HOPPER, build_hopper
from rftsim_models.quadruped import DIAGONALS, QUADRUPED, build_quadruped
from rftsim_models.rover import ROVER, build_rover
from rftsim_models.wheels import GROUSER_WHEEL, build_wheel

from rftsim import add_sand, wrenches

ROBOTS = {"hexapod": build_hexapod, "hopper": build_hopper, "quadruped": build_quadruped, "rover": build_rover}
MASSES = {"hexapod": 2.3, "hopper": 9.0, "quadruped": 11.04, "rover": 11.2}


@pytest.fixture(params=ROBOTS)
def name(request):
    return request.param


def on_sand(name, sand="medium-sand"):
    spec = ROBOTS[name]()
    add_sand(spec, sand, max_edge=parts.AS_MESHED)
    return started(spec.compile())


def on_floor(name):
    spec = ROBOTS[name]()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1], contype=0, conaffinity=1)
    return started(spec.compile())


def started(model):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    mujoco.mj_forward(model, data)
    return model, data


def step(model, data, duration):
    for _ in range(round(duration / model.opt.timestep)):
        mujoco.mj_step(model, data)
    assert not any(warning.number for warning in data.warning)


def meshes(model):
    for mesh in range(model.nmesh):
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        faces = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]]
        yield model.mesh(mesh).name, trimesh.Trimesh(model.mesh_vert[first : first + count], faces)


def tilt(model, data):
    """Angle of the torso's z axis to the vertical [rad]."""
    return np.arccos(data.xmat[model.body("torso").id][8])


def test_mass(name):
    model = ROBOTS[name]().compile()
    assert model.body_mass.sum() == pytest.approx(MASSES[name])


def test_meshes_are_closed_and_outward(name):
    for _, mesh in meshes(ROBOTS[name]().compile()):
        assert mesh.is_watertight
        assert mesh.volume > 0.0
        assert len(mesh.faces) <= 700


def test_leg_is_half_a_ring():
    """V = pi (R^2 - (R - t)^2) / 2 w, less what the chords take: 1 - sin(phi) / phi with phi = pi / segments."""
    p = HEXAPOD
    mesh = trimesh.Trimesh(*p.leg())
    exact = np.pi / 2 * (p.leg_radius**2 - (p.leg_radius - p.leg_thickness) ** 2) * p.leg_width
    phi = np.pi / p.segments
    assert mesh.volume == pytest.approx(exact * np.sin(phi) / phi, rel=1e-9)


def test_start_touches_the_ground(name):
    model, data = started(ROBOTS[name]().compile())
    assert parts.lowest(model, data) == pytest.approx(0.0, abs=1e-9)


def test_left_and_right_are_alike(name):
    model, data = started(ROBOTS[name]().compile())
    mirror = np.array([1, -1, 1])
    for body in (body for body in range(model.nbody) if "right" not in model.body(body).name):
        twin = model.body(model.body(body).name.replace("left", "right")).id
        assert data.xipos[twin] * mirror == pytest.approx(data.xipos[body], abs=1e-7)
        assert model.body_mass[twin] == pytest.approx(model.body_mass[body])
        assert np.sort(model.body_inertia[twin]) == pytest.approx(np.sort(model.body_inertia[body]), rel=1e-4)


def test_stands_on_sand(name):
    """It sinks millimetres to centimetres and rests; the sand then bears its weight."""
    model, data = on_sand(name)
    step(model, data, 1.0)
    assert -0.03 < parts.lowest(model, data) < -0.003
    assert tilt(model, data) < np.deg2rad(2)
    assert abs(data.body("torso").xpos[0]) < 0.01
    weight = 9.81 * model.body_mass.sum()
    assert wrenches(model, data).force[:, 2].sum() == pytest.approx(weight, rel=0.05)


def test_stands_on_a_floor(name):
    model, data = on_floor(name)
    step(model, data, 1.0)
    assert parts.lowest(model, data) == pytest.approx(0.0, abs=2e-3)
    assert tilt(model, data) < np.deg2rad(2)
    assert abs(data.body("torso").xpos[0]) < 0.01


@pytest.mark.parametrize("place", [on_sand, on_floor])
def test_tripods_go_straight_ahead(place):
    model, data = place("hexapod")
    data.qpos[[7 + leg for leg in TRIPODS[1]]] = np.pi
    data.ctrl[:] = 10.0
    step(model, data, 1.5)
    x, y, _ = data.body("torso").xpos
    assert x > 0.3
    assert abs(y) < 0.1 * x


@pytest.mark.parametrize("place", [on_sand, on_floor])
def test_quadruped_trots(place):
    model, data = place("quadruped")
    rest, steps_a_second = data.ctrl.copy(), 2.0
    while data.time < 1.5:
        for number, pair in enumerate(DIAGONALS):
            phase = 2 * np.pi * steps_a_second * data.time + np.pi * number
            swing, lift = 0.2 * np.cos(phase), 0.35 * max(np.sin(phase), 0.0)
            for leg in pair:
                data.ctrl[3 * leg + 1] = rest[3 * leg + 1] + swing + lift
                data.ctrl[3 * leg + 2] = rest[3 * leg + 2] - 2 * lift
        mujoco.mj_step(model, data)
    assert data.body("torso").xpos[0] > 0.2
    assert tilt(model, data) < np.deg2rad(15)


@pytest.mark.parametrize("place", [on_sand, on_floor])
def test_rover_turns_towards_its_slower_wheels(place):
    model, data = place("rover")
    data.ctrl[:] = [0.5] * 3 + [2.5] * 3
    step(model, data, 2.0)
    ahead = data.xmat[model.body("torso").id].reshape(3, 3)[:, 0]
    assert data.body("torso").xpos[0] > 0.05
    assert ahead[1] > 0.05


def test_differential_turns_the_rockers_against_each_other():
    model, data = started(build_rover().compile())
    model.opt.gravity[:] = 0.0
    data.joint("rocker_left").qfrc_applied[0] = 0.2
    step(model, data, 0.5)
    left, right = (data.joint(f"rocker_{side}").qpos[0] for side in ("left", "right"))
    assert left > 0.05
    assert right == pytest.approx(-left, rel=0.02)


def test_hopper_leaves_the_sand():
    model, data = on_sand("hopper")
    for crouch, duration in ((0.8, 0.5), (0.15, 0.1), (0.5, 0.1)):
        data.ctrl[:] = -crouch, 2 * crouch, -crouch
        step(model, data, duration)
    assert parts.lowest(model, data) > 0.02


def test_torque_turns_the_wheel():
    """Free of the ground, omega = T t / I."""
    model, data = started(build_wheel(GROUSER_WHEEL, 0, drive="torque", torque_limit=0.5).compile())
    model.opt.gravity[:] = 0.0
    data.ctrl[0] = 2.0
    step(model, data, 0.1)
    mujoco.mj_forward(model, data)
    inertia = 0.4 * GROUSER_WHEEL.vertical_mass * GROUSER_WHEEL.radius**2
    assert data.sensor("rate").data[0] == pytest.approx(0.5 * 0.1 / inertia, rel=1e-6)
    assert data.sensor("torque").data[0] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("parameters", "changes", "words"),
    [
        (HEXAPOD, {"mass": 0.0}, "mass must be positive"),
        (HEXAPOD, {"leg_mass": 0.5}, "leave nothing"),
        (HEXAPOD, {"leg_thickness": 0.04}, "less than leg_radius"),
        (HEXAPOD, {"hip_spacing": 0.2}, "do not fit"),
        (HOPPER, {"crouch": 2.0}, "where the knee's range ends"),
        (HOPPER, {"torques": (1.0, 0.0, 1.0)}, "torques must be positive"),
        (HOPPER, {"ankle_height": 0.01}, "must exceed foot_height"),
        (QUADRUPED, {"hip_spacing": 1.0}, "at most the torso's length"),
        (QUADRUPED, {"crouch": 0.1}, "where the knee's range ends"),
        (ROVER, {"spacing": 0.1}, "overlap"),
        (ROVER, {"track": 0.3}, "does not fit between"),
    ],
)
def test_impossible_robots(parameters, changes, words):
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(parameters, **changes)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"drive": "voltage"}, "drives are rate, torque"), ({"gain": 0.0}, "gain"), ({"torque_limit": -1.0}, "positive")],
)
def test_impossible_drives(options, words):
    with pytest.raises(ValueError, match=words):
        build_wheel(GROUSER_WHEEL, 60, **options)
