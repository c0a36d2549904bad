"""The engine plugin: the force that MuJoCo gets, and that nothing else about the simulation changes."""

import copy

import mujoco
import numpy as np
import pytest
from trees import BALL, JOINTS, SAND, applied, sandy, shaken, spec_of, trajectory, tree

from rftsim import add_sand, instances, surface_force, tractions, wrenches
from rftsim.law.laws import get_law


@pytest.fixture(params=["explicit", "implicit"])
def force(request):
    """Both ways in which the sand's force can enter a step."""
    return request.param


@pytest.mark.parametrize("seed", range(10))
def test_force_is_the_transposed_jacobian_times_the_wrench(seed):
    """qfrc_passive = sum over bodies of J_p^T f + J_r^T t, against mj_applyFT, on random trees of every joint."""
    rng = np.random.default_rng(seed)
    kinds = ["free", *rng.choice(["ball", "slide", "hinge", "two", "none"], size=5)]
    model = sandy(tree(rng, kinds), terrain=0.2)
    data = shaken(model, seed)
    expected = applied(model, data)
    assert np.abs(expected).max() > 1e-3
    np.testing.assert_allclose(data.qfrc_passive, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("kind", [kind for kind in JOINTS if kind != "none"])
def test_each_joint_alone(kind):
    """The same for a body, and a body fixed to it, behind each kind of joint."""
    model = sandy(tree(np.random.default_rng(3), [kind, "none", "none"]))
    data = shaken(model, 1)
    assert np.abs(data.qfrc_passive).max() > 1e-3
    np.testing.assert_allclose(data.qfrc_passive, applied(model, data), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("timestep", [0.0005, 0.002])
def test_sensors_add_up_to_the_change_of_momentum(timestep, force):
    """sum f h = m (v - v_0 + g t): exactly for the force of the moment, within a step's worth for the implicit one."""
    model = sandy(BALL, f'<option timestep="{timestep}"/>', force=force)
    data = mujoco.MjData(model)
    data.qvel[2] = -2.0
    lift = trajectory(model, data, int(0.2 / timestep))[:, model.nq + 2]
    impulse = model.body("ball").mass[0] * (data.qvel[2] + 2.0 + 9.81 * data.time)
    slack = 1e-9 if force == "explicit" else timestep * lift.max()
    assert timestep * lift.sum() == pytest.approx(impulse, abs=slack)


def test_passive_forces_of_the_model_are_kept():
    """The sand adds to springs and dampers."""
    spring = JOINTS["hinge"].replace("/>", ' stiffness="3" damping="0.5" springref="0.7"/>')
    bodies = f'<body name="b" pos="0 0 -.1">{spring}<geom size=".05" pos=".1 0 0"/></body>'
    dry, wet = spec_of(bodies).compile(), sandy(bodies)
    data = shaken(wet, 2)
    reference = mujoco.MjData(dry)
    reference.qpos[:], reference.qvel[:] = data.qpos, data.qvel
    mujoco.mj_forward(dry, reference)
    np.testing.assert_allclose(data.qfrc_passive, reference.qfrc_passive + applied(wet, data), rtol=1e-12)


@pytest.mark.parametrize("law", ["rft2d", "drft2d", "rft3d", "drft3d", "rft3d:c4", "drft3d:c4"])
def test_one_number_everywhere(law):
    """Sensor = wrench = sum of tractions = `surface_force` of the same surface, pose and twist."""
    planar = get_law(law).planar
    kinds = ["planar", "pitch", "none"] if planar else ["free", "hinge", "none"]
    spec = spec_of(tree(np.random.default_rng(5), kinds, planar=planar))
    bed = add_sand(spec, SAND, law, terrain=0.1, force="explicit")
    model = spec.compile()
    data = shaken(model, 4)
    found = wrenches(model, data)
    for name, surface in bed.surfaces.items():
        i = model.body(name).id
        np.testing.assert_array_equal(data.sensor(f"{name}_sand").data, [*found.force[i], *found.moment[i]])
        faces = tractions(model, data, name)
        forces = faces.stress * faces.area[:, None]
        scale = np.abs(forces).sum()
        np.testing.assert_allclose(forces.sum(axis=0), found.force[i], atol=1e-12 * scale)
        moment = np.cross(faces.centre - data.xpos[i], forces).sum(axis=0)
        np.testing.assert_allclose(moment, found.moment[i], atol=1e-12 * scale)
        twist = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, i, twist, 0)
        pose = {"position": data.xpos[i], "rotation": data.xmat[i].reshape(3, 3)}
        pose |= {"velocity": twist[3:], "angular_velocity": twist[:3], "terrain": bed.terrain}
        alone = surface_force(surface, SAND, law, **pose)
        np.testing.assert_allclose(alone.force, found.force[i], atol=1e-12 * scale)
        np.testing.assert_allclose(alone.moment, found.moment[i], atol=1e-12 * scale)
        assert found.power[i] == pytest.approx(alone.power, abs=1e-12 * scale)
        np.testing.assert_array_equal(faces.active, alone.active)
    assert not found.force[0].any()


@pytest.mark.parametrize("seed", range(3))
def test_bodies_are_felt_from_their_first_triangle(seed):
    """What is passed over above the sand is above it: lowered by millimetres, the wrench is the sum of tractions."""
    rng = np.random.default_rng(seed)
    model = sandy(tree(rng, ["free"]), max_edge=0.01)
    data = mujoco.MjData(model)
    data.qpos[3:7] = rng.normal(size=4)
    data.qvel[:] = rng.normal(size=6)
    felt = 0
    for height in np.arange(0.2, -0.2, -0.004):
        data.qpos[2] = height
        mujoco.mj_forward(model, data)
        faces = tractions(model, data, 1)
        forces = faces.stress * faces.area[:, None]
        felt += forces.any()
        np.testing.assert_allclose(wrenches(model, data).force[1], forces.sum(axis=0), rtol=1e-9, atol=1e-12)
    assert 10 < felt < 90


def test_free_fall_above_the_sand_is_free(force):
    """Nothing acts above the sand: the ball falls by g t^2 / 2, as without."""
    high = BALL.replace(".02", "5")
    wet, dry = sandy(high, force=force), spec_of(high).compile()
    fall = [trajectory(model, mujoco.MjData(model), 100)[:, :7] for model in (wet, dry)]
    np.testing.assert_array_equal(*fall)


def test_readout_names_bodies_without_sand():
    """Asking for the tractions of a body that feels none is an error that says so."""
    model = sandy(BALL + BALL.replace("ball", "other"), bodies=["ball"])
    data = shaken(model)
    assert not wrenches(model, data).force[model.body("other").id].any()
    with pytest.raises(ValueError, match="other"):
        tractions(model, data, "other")


def test_forward_has_no_side_effect(force):
    """mj_forward changes no state and gives the same force each time."""
    model = sandy(force=force)
    data = shaken(model)
    state = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    before, forces = state.copy(), [data.qfrc_passive.copy()]
    for _ in range(3):
        mujoco.mj_forward(model, data)
        forces.append(data.qfrc_passive.copy())
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    np.testing.assert_array_equal(state, before)
    np.testing.assert_array_equal(forces, forces[:1] * 4)


def test_reset(force):
    """After mj_resetData the wrench is zero and the trajectory is that of new data."""
    model = sandy(force=force)
    data = shaken(model)
    trajectory(model, data, 5)
    assert wrenches(model, data).force.any()
    mujoco.mj_resetData(model, data)
    assert not wrenches(model, data).force.any()
    np.testing.assert_array_equal(trajectory(model, data), trajectory(model, mujoco.MjData(model)))


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicit", "implicitfast"])
def test_integrators_run(integrator, force):
    """A dropped ball is slowed by the sand under each integrator."""
    model = sandy(BALL, f'<option integrator="{integrator}" timestep="0.0005"/>', force=force)
    data = mujoco.MjData(model)
    data.qvel[2] = -2.0
    mujoco.mj_step(model, data, 400)
    assert -0.3 < data.qpos[2] < 0.1
    assert abs(data.qvel[2]) < 0.3
    assert not any(data.warning.number)


def test_two_beds():
    """Beds of different sand in one model: each body feels its own, and the force is proportional to xi_n."""
    spec = spec_of(BALL + BALL.replace('"ball" pos="0', '"other" pos="9'))
    add_sand(spec, SAND, bodies=["ball"], force="explicit")
    add_sand(spec, SAND.replace(xi_n=3 * SAND.xi_n), bodies=["other"], name="second", force="explicit")
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[[2, 8]] = -1.0
    mujoco.mj_forward(model, data)
    weak, strong = data.sensor("ball_sand").data, data.sensor("other_sand").data
    assert weak[2] > 1.0
    np.testing.assert_allclose(strong, 3 * weak, rtol=1e-9, atol=1e-9)
    assert {bed.name: list(bed.bodies) for bed in instances(model)} == {"sand": [1], "second": [2]}


def test_sand_can_be_changed_in_a_compiled_model():
    """`instances` gives views of the model's numbers: doubling xi_n doubles the force."""
    model = sandy()
    data = shaken(model)
    before = data.qfrc_passive.copy()
    instances(model)[0].bed.xi_n *= 2.0
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_passive, 2 * before, rtol=1e-14)


@pytest.mark.parametrize("affixes", [("left/", ""), ("a_", "_z"), ("rftsim-body:", "")])
def test_attachment(affixes, force):
    """MjSpec.attach copies sand with any prefix and suffix; two copies in one model act alike."""
    child = spec_of()
    add_sand(child, SAND, force=force)
    parent = mujoco.MjSpec()
    parent.copy_during_attach = True
    for x, (prefix, suffix) in enumerate((affixes, ("other.", ".b"))):
        parent.attach(child, frame=parent.worldbody.add_frame(pos=[3.0 * x, 0, 0]), prefix=prefix, suffix=suffix)
    model = parent.compile()
    data = mujoco.MjData(model)
    data.qvel[[2, 8]] = -1.0
    mujoco.mj_forward(model, data)
    first, second = (data.sensor(f"{p}ball_sand{s}").data for p, s in (affixes, ("other.", ".b")))
    assert first[2] > 1.0
    np.testing.assert_allclose(first, second, rtol=1e-12 if force == "explicit" else 1e-4, atol=1e-12)
    assert [bed.name for bed in instances(model)] == [f"{affixes[0]}sand{affixes[1]}", "other.sand.b"]


def test_copied_data_continues_bit_identically(force):
    """copy.copy(data) goes on as the original does."""
    model = sandy(force=force)
    data = shaken(model)
    trajectory(model, data, 5)
    twin = copy.copy(data)
    np.testing.assert_array_equal(wrenches(model, twin).force, wrenches(model, data).force)
    np.testing.assert_array_equal(trajectory(model, twin), trajectory(model, data))


def test_missing_sand_is_an_error_of_the_model():
    """A model whose numbers are gone is refused when its data are made, instead of feeling nothing."""
    spec = spec_of()
    add_sand(spec, SAND)
    spec.delete(spec.numerics[0])
    with pytest.raises((ValueError, mujoco.FatalError), match="plugin"):
        mujoco.MjData(spec.compile())
