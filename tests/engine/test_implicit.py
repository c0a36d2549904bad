"""The implicit force at long steps: depth, rest, and the energy balance."""

import mujoco
import numpy as np
import pytest

import rftsim

SAND = rftsim.Sand(xi_n=0.92e6, mu_surf=0.4)
SHAPES = {
    "plate": ('<geom type="box" size="0.05 0.05 0.005" mass="0.02"/>', 0.005),
    "heavy": ('<geom size="0.05" mass="1.5"/>', 0.05),
    "light": ('<geom size="0.05" mass="0.02"/>', 0.05),
}


def drop(shape, h, seconds=0.5):
    """Model and data after a drop from rest with the centre 0.05 m above the sand, and the depth [m]."""
    geom, below = SHAPES[shape]
    body = f'<body name="b" pos="0 0 0.05"><freejoint/>{geom}</body>'
    xml = f'<mujoco><option timestep="{h}"/><worldbody>{body}</worldbody></mujoco>'
    model = rftsim.load(xml, SAND, force="implicit")
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=round(seconds / h))
    return model, data, below - data.qpos[2]


@pytest.mark.slow
@pytest.mark.parametrize("h", [1e-4, 1e-3, 2e-3, 5e-3])
def test_plate_keeps_the_energy_balance(h):
    """m g (H + z) = xi_n alpha_z A z^2 / 2 for a flat plate dropped by H: z = 1.505 mm."""
    fall = 0.05 - 0.005
    weight, stiffness = 0.02 * 9.81, 0.92e6 * 0.87574 * 0.01
    exact = (weight + np.sqrt(weight**2 + 2 * stiffness * weight * fall)) / stiffness
    assert exact == pytest.approx(1.505e-3, rel=1e-3)
    assert drop("plate", h)[2] == pytest.approx(exact, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["heavy", "light"])
@pytest.mark.parametrize(("h", "share"), [(1e-3, 0.02), (2e-3, 0.02), (5e-3, 0.02), (1e-2, 0.05)])
def test_spheres_are_as_deep_as_at_short_steps(shape, h, share):
    assert drop(shape, h)[2] == pytest.approx(drop(shape, 1e-4)[2], rel=share)


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_bodies_rest(shape, h):
    """Left alone for 10 s: drift under 0.05 mm, speed under 1e-4 m/s, spin under 1e-3 rad/s, the weight is carried."""
    model, data, _ = drop(shape, h)
    before = data.qpos.copy()
    mujoco.mj_step(model, data, nstep=round(10 / h))
    assert np.linalg.norm(data.qpos[:3] - before[:3]) < 5e-5
    assert np.linalg.norm(data.qvel[:3]) < 1e-4
    assert np.linalg.norm(data.qvel[3:]) < 1e-3
    assert rftsim.wrenches(model, data).force[1][2] == pytest.approx(9.81 * model.body("b").mass[0], rel=1e-6)
    assert rftsim.work(model, data).unsolved == 0


@pytest.mark.slow
def test_few_evaluations_at_rest():
    """A body at rest costs about one evaluation a step."""
    model, data, _ = drop("heavy", 5e-3, seconds=10.0)
    work = rftsim.work(model, data)
    assert work.evaluations + 4 * work.jacobians < 1.2 * work.steps
