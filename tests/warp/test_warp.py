"""Sand in mujoco_warp, on Warp's CPU device, against the engine plugin and against laws that hold."""

import mujoco
import mujoco_warp as mjw
import numpy as np
import pytest
import warp as wp

import rftsim
import rftsim.warp
from rftsim.bench.quadruped import QUADRUPED
from rftsim.bench.subjects import SUBJECTS, Subject
from rftsim.errors import SceneError
from rftsim.surface.triangles import Array

SAND = rftsim.Sand(xi_n=0.92e6, mu_surf=0.4, rho_c=2000.0, mu_int=0.6, lambda_=1.1)
BALL = '<body name="ball" pos="0 0 .04"><freejoint/><geom size=".05" mass="1.3"/></body>'


def _spec(world: str, law: str = "rft3d", **options: object) -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><option timestep=".005" integrator="implicitfast"/><worldbody>{world}</worldbody></mujoco>'
    )
    rftsim.add_sand(spec, SAND, law, draw=False, **options)
    return spec


def _random_motion(model: mujoco.MjModel, n: int) -> tuple[Array, Array]:
    """Positions about the surface and velocities, (n, nq) and (n, nv), of a model of one body."""
    random = np.random.default_rng(5)
    qpos = np.tile(mujoco.MjData(model).qpos, (n, 1))
    if model.nq == 7:
        qpos[:, 2] = random.uniform(-0.1, 0.05, n)
        qpos[:, 3:] = random.normal(size=(n, 4))
        qpos[:, 3:] /= np.linalg.norm(qpos[:, 3:], axis=1)[:, None]
    else:
        qpos += random.uniform(-0.03, 0.03, (n, model.nq))
    return qpos, random.normal(size=(n, model.nv)) * np.where(np.arange(model.nv) < 2, 0.5, 3.0)


def _forces(model: mujoco.MjModel, qpos: Array, qvel: Array) -> tuple[Array, Array]:
    """The sand's generalised force in each motion: of Warp, and of the engine plugin."""
    worlds = rftsim.warp.put(model, nworld=len(qpos))
    worlds.d.qpos.assign(qpos.astype("f4"))
    worlds.d.qvel.assign(qvel.astype("f4"))
    mjw.forward(worlds.m, worlds.d)
    got = worlds.d.qfrc_passive.numpy()
    data, wanted = mujoco.MjData(model), np.empty(qvel.shape)
    for i in range(len(qpos)):
        data.qpos[:], data.qvel[:] = worlds.d.qpos.numpy()[i], worlds.d.qvel.numpy()[i]
        mujoco.mj_forward(model, data)
        wanted[i] = data.qfrc_passive
    return got, wanted


@pytest.mark.parametrize("law", ["rft3d", "drft3d", "rft3d:c4"])
def test_warp_gives_the_same_force_in_space(law: str) -> None:
    """200 motions of a box with 600 triangles: single precision is 1e-5 of the largest component away."""
    spec = _spec(
        '<body name="box" pos="0 0 0"><freejoint/><geom type="box" size=".05 .08 .03"/></body>',
        law,
        force="explicit",
        max_edge=0.02,
    )
    model = rftsim.warp.compile_coupled(spec)
    got, wanted = _forces(model, *_random_motion(model, 200))
    assert np.abs(wanted).max() > 10.0
    assert np.abs(got - wanted).max() <= 1e-5 * np.abs(wanted).max()


@pytest.mark.parametrize("law", ["rft2d", "drft2d"])
def test_warp_gives_the_same_force_in_the_plane(law: str) -> None:
    """200 motions of the shipped grousered wheel, whose drop is part of drft2d.

    A triangle on the edge of the drop, or of what leads, may fall on its other side in single precision.
    """
    model = SUBJECTS["wheel"].stage(law, force="explicit").model
    got, wanted = _forces(model, *_random_motion(model, 200))
    error = np.abs(got - wanted).max(axis=1) / np.abs(wanted).max()
    assert np.quantile(error, 0.95) <= 1e-5
    assert error.max() <= 5e-3


def _settled(nworld: int, xi_n: "list[float] | None" = None, steps: int = 600) -> rftsim.warp.Worlds:
    """Balls that fell into sand of several strengths, and lay there."""
    worlds = rftsim.warp.put(_spec(BALL), nworld=nworld)
    if xi_n is not None:
        worlds.sand.beds[0].vary("xi_n")
        worlds.sand.beds[0].sands.xi_n.assign(np.array(xi_n, dtype="f4"))
    for _ in range(steps):
        mjw.step(worlds.m, worlds.d)
    return worlds


def test_a_ball_on_warp_comes_to_rest_and_stays() -> None:
    """At steps of 5 ms a ball that fell in rests: in 3 s it moves by less than a micrometre, and bears its weight."""
    worlds = _settled(1, steps=200)
    before = worlds.d.qpos.numpy()[0].copy()
    for _ in range(600):
        mjw.step(worlds.m, worlds.d)
    assert np.abs(worlds.d.qpos.numpy()[0] - before).max() < 1e-6
    assert np.abs(worlds.d.qvel.numpy()).max() < 1e-6
    wrench = worlds.sand.wrenches(worlds.d)[0].numpy()[0, 0]
    assert wrench[2] == pytest.approx(1.3 * 9.81, rel=1e-4)


def test_worlds_of_warp_do_not_know_of_one_another() -> None:
    """64 worlds with 64 sands end bit by bit where each ends alone, and in weaker sand lower."""
    strengths = np.linspace(0.5e6, 2e6, 64).tolist()
    together = _settled(64, strengths, 120).d.qpos.numpy()
    for world in (0, 17, 63):
        np.testing.assert_array_equal(_settled(1, strengths[world : world + 1], 120).d.qpos.numpy()[0], together[world])
    assert (np.diff(together[::9, 2]) > 0.0).all()


def test_warp_repeats_itself() -> None:
    """Two runs are bit-identical."""
    np.testing.assert_array_equal(_settled(2, steps=120).d.qvel.numpy(), _settled(2, steps=120).d.qvel.numpy())


def test_reset_on_warp_forgets() -> None:
    """A world that is reset goes the way that it went before; one that is not stays where it is."""
    worlds = _settled(2, steps=100)
    first = worlds.d.qpos.numpy().copy()
    mask = wp.array([True, False], dtype=bool)
    mjw.reset_data(worlds.m, worlds.d, mask)
    worlds.sand.reset(mask)
    for _ in range(100):
        mjw.step(worlds.m, worlds.d)
    again = worlds.d.qpos.numpy()
    np.testing.assert_array_equal(again[0], first[0])
    assert np.abs(again[1] - first[1]).max() < 1e-6


def test_reset_on_warp_forgets_the_constraints() -> None:
    """Their force in the last step, which mujoco_warp's reset leaves, is no part of the first guess of a new world."""
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body name="ball" pos="0 0 0.045"><joint type="slide" axis="0 0 1" frictionloss="3"/>'
        '<geom size=".05" mass="1"/></body></worldbody></mujoco>'
    )
    rftsim.add_sand(spec, "preset=poppy-seeds")
    worlds = rftsim.warp.put(spec, nworld=2, iterations=2)
    ways = []
    for past in (0.0, 50.0):
        mjw.reset_data(worlds.m, worlds.d)
        worlds.d.qfrc_constraint.fill_(past)
        worlds.sand.reset()
        way = []
        for _ in range(5):
            mjw.step(worlds.m, worlds.d)
            way.append(worlds.d.qpos.numpy().copy())
        ways.append(way)
    np.testing.assert_array_equal(*ways)


def _apart(subject: Subject, h: float, duration: float, iterations: int) -> float:
    """How far a robot on Warp gets from the engine plugin's at most, over the length of its way."""
    model = subject.stage(subject.laws[0]).model
    model.opt.timestep = h
    data, every = subject.start(model), round(0.02 / h)
    worlds = rftsim.warp.put(model, subject.start(model), iterations=iterations, njmax=64, nconmax=32)
    places, apart = [data.qpos[:2].copy()], 0.0
    for i in range(round(duration / h)):
        if subject.move is not None and i % every == 0:
            data.ctrl[:] = subject.move(model, data.time)
            worlds.d.ctrl.assign(data.ctrl[None].astype("f4"))
        mujoco.mj_step(model, data)
        mjw.step(worlds.m, worlds.d)
        places.append(data.qpos[:2].copy())
        apart = max(apart, float(np.linalg.norm(worlds.d.qpos.numpy()[0, :2] - data.qpos[:2])))
    return apart / float(np.linalg.norm(np.diff(places[::every], axis=0), axis=1).sum())


def test_a_hexapod_on_warp_goes_the_same_way() -> None:
    """Half a second of the shipped hexapod's walk at 1 ms, within 2 % of the engine plugin's way."""
    assert _apart(SUBJECTS["hexapod"], 1e-3, 0.5, rftsim.warp.ITERATIONS) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wheel", "runner", "hexapod", "quadruped"])
def test_robots_on_warp_go_the_same_way(name: str) -> None:
    """Two seconds of each at its own step, 5 ms for the robots, within 1 % of the engine plugin's way."""
    subject = {**SUBJECTS, "quadruped": QUADRUPED}[name]
    model = subject.stage(subject.laws[0]).model
    assert _apart(subject, model.opt.timestep, 2.0, 8) < 0.01


def test_sensors_on_warp_read_the_wrench() -> None:
    """A wrench sensor of the model reads the weight of a ball at rest, at its place in sensordata."""
    worlds = rftsim.warp.put(_spec(BALL, sensors=True))
    for _ in range(250):
        mjw.step(worlds.m, worlds.d)
    start = worlds.plain.sensor("ball_sand").adr[0]
    assert worlds.d.sensordata.numpy()[0, start + 2] == pytest.approx(1.3 * 9.81, rel=1e-3)


def test_what_warp_does_not_know_is_refused() -> None:
    """No sand, a terrain, or a mass matrix that is kept as a diagonal: one line, with the remedy."""
    with pytest.raises(SceneError, match="no sand"):
        rftsim.warp.put(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{BALL}</worldbody></mujoco>"))
    with pytest.raises(SceneError, match="plane without ruts"):
        rftsim.warp.put(_spec(BALL, terrain="dunes"))
    with pytest.raises(SceneError, match="MjSpec"):
        rftsim.warp.put(_spec(BALL).compile())
    spec = _spec(BALL)
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    with pytest.raises(SceneError, match="sleep and energy"):
        rftsim.warp.put(spec)
    with pytest.raises(ValueError, match="no parameter 'xi'"):
        _settled(1, steps=0).sand.beds[0].vary("xi")
