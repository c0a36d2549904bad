"""Sand that remembers: what is displaced stays, slides to the angle of repose, and is in each data of its own."""

import pickle

import mujoco
import numpy as np
import pytest

import rftsim
from rftsim import Ruts, Sand, SandError

SAND = Sand(rho_c=1512.0, mu_int=0.4, mu_surf=0.35)
REPOSE = 0.4
JOINT = {"z": "0 0 1", "x": "1 0 0"}


def driven(geom, along, at, ruts=True, **options):
    """A body on a slide, whose velocity is the control [m/s]."""
    spec = mujoco.MjSpec.from_string(f"""
        <mujoco><option timestep="0.002" integrator="implicitfast"/>
        <worldbody>
          <body name="tool" pos="{at}"><joint name="way" type="slide" axis="{JOINT[along]}"/>{geom}</body>
        </worldbody>
        <actuator><velocity joint="way" kv="20000"/></actuator></mujoco>""")
    rftsim.add_sand(spec, SAND, terrain=0.0, ruts=ruts, draw=False, reduction=0.0, max_edge=0.02, **options)
    model = spec.compile()
    return model, mujoco.MjData(model)


def go(model, data, speed, way):
    """Move at a speed [m/s] for a way [m]; the force along the slide, (n,), at its positions, (n,)."""
    forces, places = [], []
    axis = int(np.argmax(model.jnt_axis[0]))
    for _ in range(round(abs(way / speed) / model.opt.timestep)):
        data.ctrl[:] = speed
        mujoco.mj_step(model, data)
        places.append(data.qpos[0])
        forces.append(rftsim.wrenches(model, data).force[1, axis])
    return np.array(places), np.array(forces)


FOOT = '<geom type="box" size=".025 .3 .03" mass="1"/>'
BALL = '<geom type="sphere" size=".05" mass="1"/>'


def steepest(ground):
    """The steepest slope between neighbouring cells, along rows, columns and diagonals [-]."""
    cells, side = ground.marks, ground.spacing[0]
    straight = max(np.abs(np.diff(cells, axis=k)).max() for k in (0, 1))
    across = max(np.abs(cells[1:, 1:] - cells[:-1, :-1]).max(), np.abs(cells[1:, :-1] - cells[:-1, 1:]).max())
    return max(straight, across / np.sqrt(2.0)) / side


@pytest.fixture(scope="module")
def print_of_a_foot():
    model, data = driven(FOOT, "z", "0 0 .032")
    first = go(model, data, -0.1, 0.032)
    pressed = rftsim.ground(model, data)
    go(model, data, 0.1, 0.05)
    go(model, data, 0.001, 0.0003)
    lifted = rftsim.ground(model, data)
    return first, pressed, lifted, go(model, data, -0.1, 0.065)


def test_volume_is_conserved_to_rounding(print_of_a_foot):
    _, pressed, lifted, _ = print_of_a_foot
    for ground in (pressed, lifted):
        assert ground.displaced > 4e-4  # 30 mm below 50 x 600 mm are 9e-4
        assert abs(ground.volume) < 1e-12 * ground.displaced


def test_no_slope_stays_steeper_than_the_angle_of_repose(print_of_a_foot):
    _, pressed, lifted, _ = print_of_a_foot
    assert steepest(lifted) < 1.001 * REPOSE
    assert steepest(pressed) > 2.0 * REPOSE  # the foot holds the walls of its print


def test_a_print_is_half_as_deep_as_it_was_pressed(print_of_a_foot):
    """The continuum leaves 14 mm of 30, rims of 8.7 mm that are highest 85 mm from the middle."""
    ground = print_of_a_foot[2]
    x = np.linspace(-0.15, 0.15, 301)
    height = ground.height_at(x, 0.0 * x)
    assert height.min() == pytest.approx(-0.014, abs=0.003)
    assert 0.005 < height.max() < 0.010


def test_a_foot_that_is_lifted_within_a_cell_leaves_the_depth_that_it_reached():
    """Its marks are made when it begins to rise, up to a fiftieth of a cell and the step in which it turns."""
    spacing, deep, speed = 0.02, 0.012, 0.1
    model, data = driven(FOOT, "z", "0 0 .03", ruts=Ruts(spacing, (1.3, 1.3)))
    go(model, data, -speed, deep)
    lowest = data.qpos[0]
    go(model, data, speed, 0.004)
    assert -rftsim.ground(model, data).height_at(0.0, 0.0) == pytest.approx(-lowest, abs=0.02 * spacing + 0.002 * speed)


def test_the_first_push_is_that_of_undisturbed_sand(print_of_a_foot):
    places, forces = print_of_a_foot[0]
    model, data = driven(FOOT, "z", "0 0 .032", ruts=False)
    expected = go(model, data, -0.1, 0.032)[1]
    deep = places < -0.007
    np.testing.assert_allclose(forces[deep], expected[deep], rtol=0.05)


def test_the_second_push_into_a_print_is_soon_as_hard_as_the_first(print_of_a_foot):
    """The continuum has 0, 0.07, 0.94, 0.98 and 0.93 of the first force at 6, 12, 18, 24 and 28 mm."""
    (at, first), _, _, (again, second) = print_of_a_foot
    depth = np.array([0.002, 0.018, 0.024, 0.028]) + 0.002
    ratio = np.interp(-depth, again[::-1], second[::-1]) / np.interp(-depth, at[::-1], first[::-1])
    np.testing.assert_allclose(ratio, [0.0, 0.94, 0.98, 0.93], atol=0.1)


def test_a_print_is_the_image_of_itself(print_of_a_foot):
    """But for points between two cells, which count for one of them: to a twelfth of a cell."""
    ground = print_of_a_foot[2]
    x = np.linspace(0.0, 0.15, 61)
    np.testing.assert_allclose(ground.height_at(x, 0.0 * x), ground.height_at(-x, 0.0 * x), atol=1e-3)


def test_what_leaves_the_window_is_counted():
    model, data = driven(BALL, "x", "0 0 .02", Ruts(0.02, (0.64, 0.64)))
    go(model, data, 0.5, 2.0)
    ground = rftsim.ground(model, data)
    assert ground.window[0][0] > 0.9  # it has followed
    assert abs(ground.left) > 1e-6
    assert abs(ground.volume) < 1e-9 * ground.displaced


def test_sand_that_was_not_touched_is_as_it_was():
    model, data = driven(BALL, "z", "0 0 .2")
    go(model, data, 0.1, 0.05)
    ground = rftsim.ground(model, data)
    assert not ground.marks.any()
    assert ground.displaced == 0.0


def stepped(model, data, steps):
    for _ in range(steps):
        data.ctrl[:] = 0.3 if data.time % 0.2 < 0.1 else -0.3
        mujoco.mj_step(model, data)
    return np.concatenate([data.qpos, data.qvel, data.plugin_state])


def test_copies_pickles_and_reset_go_on_as_the_one_does():
    model, data = driven(FOOT, "z", "0 0 .02")
    fresh = stepped(model, data, 100)
    twin = mujoco.MjData(model)
    mujoco.mj_copyData(twin, model, data)
    other_model, thawed = pickle.loads(pickle.dumps((model, data)))
    expected = stepped(model, data, 100)
    assert expected.tobytes() == stepped(model, twin, 100).tobytes()
    assert expected.tobytes() == stepped(other_model, thawed, 100).tobytes()
    mujoco.mj_resetData(model, data)
    assert not data.plugin_state.any()
    assert fresh.tobytes() == stepped(model, data, 100).tobytes()


def test_states_are_set_and_got_with_their_ruts():
    model, data = driven(FOOT, "z", "0 0 .02")
    stepped(model, data, 100)
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    other = mujoco.MjData(model)
    mujoco.mj_setState(model, other, state, kind)
    assert stepped(model, data, 50).tobytes() == stepped(model, other, 50).tobytes()


@pytest.mark.parametrize("threads", [1, 2])
def test_batches_are_single_runs(threads):
    batch = pytest.importorskip("mujoco.batch")
    model, data = driven(FOOT, "z", "0 0 .02")
    many = batch.Batch(model, 3, threads)
    many.bind("ctrl")[:] = np.array([[-0.1], [-0.2], [0.1]])
    many.rollout(150)
    found = np.array(many.bind("plugin_state"))
    for k, speed in enumerate((-0.1, -0.2, 0.1)):
        mujoco.mj_resetData(model, data)
        data.ctrl[:] = speed
        mujoco.mj_step(model, data, nstep=150)
        assert found[k].tobytes() == data.plugin_state.tobytes()


@pytest.mark.parametrize("size", [{"spacing": 0.0, "window": (1.0, 1.0)}, {"spacing": 0.01, "window": (0.0, 1.0)}])
def test_ruts_that_are_none_are_refused(size):
    with pytest.raises(ValueError, match="must be"):
        Ruts(**size)


def test_a_window_of_too_many_cells_is_refused():
    with pytest.raises(ValueError, match="more than 1024 cells"):
        Ruts(0.001, (2.0, 1.0))


def test_sand_without_internal_friction_cannot_remember():
    with pytest.raises(SandError, match="mu_int"):
        rftsim.load(f"<mujoco><worldbody><body><freejoint/>{BALL}</body></worldbody></mujoco>",
                    Sand(xi_n=1e5, mu_surf=0.4), ruts=True)  # fmt: skip


@pytest.mark.slow
def test_a_drive_of_twenty_metres_loses_no_sand():
    model, data = driven(BALL, "x", "0 0 .02")
    go(model, data, 1.0, 20.0)
    ground = rftsim.ground(model, data)
    assert abs(ground.volume) < 1e-9 * ground.displaced
