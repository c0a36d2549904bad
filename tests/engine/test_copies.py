"""One model, many simulations: copies, pickles, rollouts, batches, threads and the end of a process give one answer."""

import copy
import os
import pickle
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import mujoco
import numpy as np
import pytest
from checked import CHECKED
from mujoco import rollout
from trees import BALL, SAND, sandy, spec_of, trajectory, tree

from rftsim import add_sand, wrenches
from rftsim.law.layout import BED
from rftsim.model.readout import instances

NSTEP = 40


@pytest.fixture(scope="module", params=["explicit", "implicit"])
def model(request):
    """A free body with a hinged and a fixed one, in the sand."""
    return sandy(tree(np.random.default_rng(11), ["free", "hinge", "none"]), terrain=0.1, force=request.param)


def starts_of(model):
    """Eight states, (8, nstate)."""
    rng, data, spec = np.random.default_rng(0), mujoco.MjData(model), mujoco.mjtState.mjSTATE_FULLPHYSICS
    states = np.zeros((8, mujoco.mj_stateSize(model, spec)))
    for state in states:
        data.qvel[:] = rng.normal(size=model.nv)
        mujoco.mj_getState(model, data, state, spec)
    return states


@pytest.fixture(scope="module")
def starts(model):
    """Of the model."""
    return starts_of(model)


@pytest.fixture(scope="module")
def alone(model, starts):
    """Each start's states and sensor values, step by step, from data of its own."""
    spec = mujoco.mjtState.mjSTATE_FULLPHYSICS
    states, sensors = np.zeros((8, NSTEP, starts.shape[1])), np.zeros((8, NSTEP, model.nsensordata))
    for i, start in enumerate(starts):
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, start, spec)
        for k in range(NSTEP):
            mujoco.mj_step(model, data)
            mujoco.mj_getState(model, data, states[i, k], spec)
            sensors[i, k] = data.sensordata
    assert np.abs(sensors).max() > 1.0
    return states, sensors


def run(model, start):
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return trajectory(model, data, NSTEP)[:, -model.nsensordata :]


@pytest.mark.parametrize(
    "clone", [copy.copy, copy.deepcopy, lambda m: pickle.loads(pickle.dumps(m))], ids=["copy", "deepcopy", "pickle"]
)
def test_copied_and_pickled_models(model, starts, alone, clone):
    """A copy of the model carries the sand, and runs bit-identically."""
    np.testing.assert_array_equal(run(clone(model), starts[0]), alone[1][0])


def test_saved_binary_model(model, starts, alone, tmp_path):
    """So does a model that was saved as MJB."""
    path = tmp_path / "model.mjb"
    mujoco.mj_saveModel(model, str(path))
    np.testing.assert_array_equal(run(mujoco.MjModel.from_binary_path(str(path)), starts[0]), alone[1][0])


@pytest.mark.parametrize("nthread", [1, 2])
def test_rollout(model, starts, alone, nthread):
    """mujoco.rollout, on one and two threads, is bit-identical to a loop."""
    data = [mujoco.MjData(model) for _ in range(nthread)]
    states, sensors = rollout.rollout(model, data, starts, nstep=NSTEP)
    np.testing.assert_array_equal(states, alone[0])
    np.testing.assert_array_equal(sensors, alone[1])


def batch_of(model, starts, nthread, **options):
    batch = pytest.importorskip("mujoco.batch").Batch(model, nsim=len(starts), nthread=nthread, **options)
    data = mujoco.MjData(model)
    for i, start in enumerate(starts):
        mujoco.mj_setState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        batch.bind("qpos")[i], batch.bind("qvel")[i] = data.qpos, data.qvel
    return batch


@pytest.mark.parametrize("nthread", [1, 2])
@pytest.mark.parametrize("persistent", [False, True])
def test_batch(model, starts, alone, nthread, persistent):
    """mujoco.batch, with data shared among simulations or not, is bit-identical to a loop."""
    batch = batch_of(model, starts, nthread, persistent=persistent)
    sensors = batch.bind("sensordata")
    for k in range(NSTEP):
        batch.step()
        np.testing.assert_array_equal(sensors, alone[1][:, k])


def test_batch_with_sand_of_its_own_in_each_simulation():
    """batch.expand("numeric_data") randomises the sand: at the same state, 2 xi_n gives twice the force."""
    model = sandy()
    batch = batch_of(model, np.zeros((3, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))), 2)
    batch.bind("qpos")[:], batch.bind("qvel")[:, 2] = model.qpos0, -1.0
    instances(model)[0].beds_in(batch.expand("numeric_data"))["xi_n"][1] *= 2.0
    sensors = batch.bind("sensordata")
    batch.step()
    assert sensors[0, 2] > 1.0
    np.testing.assert_allclose(sensors[1], 2.0 * sensors[0], rtol=1e-12)
    np.testing.assert_array_equal(sensors[2], sensors[0])


@pytest.mark.parametrize("nthread", [1, 2])
@pytest.mark.parametrize("force", ["explicit", "implicit"])
def test_batch_with_random_sand(force, nthread):
    """Strength, friction and density of its own in each simulation: bit-identical to single runs with that sand."""
    bodies = tree(np.random.default_rng(11), ["free", "hinge", "none"])
    model = sandy(bodies, terrain=0.1, law="drft3d", force=force)
    starts = starts_of(model)
    batch = batch_of(model, starts, nthread)
    sand = model.numeric("rftsim-sand:sand").adr[0] + np.arange(instances(model)[0].packed.size)
    factors = np.ones((len(starts), sand.size))
    drawn = [BED.fields[name][1] // 8 for name in ("xi_n", "zeta", "mu_surf", "rho_c")]
    factors[:, drawn] = np.exp(np.random.default_rng(3).uniform(-0.7, 0.7, size=(len(starts), len(drawn))))
    batch.expand("numeric_data")[:, sand] *= factors
    sensors, state = batch.bind("sensordata"), {name: batch.bind(name) for name in ("qpos", "qvel")}
    singles = []
    for start, factor in zip(starts, factors, strict=True):
        own = copy.copy(model)
        own.numeric_data[sand] *= factor
        data = mujoco.MjData(own)
        mujoco.mj_setState(own, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        singles.append((own, data))
    for _ in range(NSTEP):
        batch.step()
        for i, (own, data) in enumerate(singles):
            mujoco.mj_step(own, data)
            np.testing.assert_array_equal(sensors[i], data.sensordata)
            for name, rows in state.items():
                np.testing.assert_array_equal(rows[i], getattr(data, name))
    assert len({tuple(row) for row in sensors}) == len(starts)


def test_threads(model, starts, alone):
    """Python threads that step data of their own do not meet."""
    found = {}
    threads = [threading.Thread(target=lambda i=i: found.update({i: run(model, starts[i])})) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for i in range(4):
        np.testing.assert_array_equal(found[i], alone[1][i])


def test_dm_control(model, starts, alone):
    """A dm_control Physics of a compiled model runs bit-identically, and its copies too."""
    os.environ.setdefault("MUJOCO_GL", "egl")
    engine = pytest.importorskip("dm_control.mujoco")
    wrapper = pytest.importorskip("dm_control.mujoco.wrapper")
    physics = engine.Physics.from_model(wrapper.MjModel(model))
    with physics.reset_context():
        mujoco.mj_setState(model, physics.data.ptr, starts[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    for k in range(3):
        physics.step()
        np.testing.assert_array_equal(physics.data.qpos, alone[0][0, k, 1 : 1 + model.nq])
    assert wrenches(physics.model.ptr, physics.data.ptr).force.any()
    twin = physics.copy(share_model=True)
    for each in (physics, twin):
        each.step()
        np.testing.assert_array_equal(each.data.qpos, alone[0][0, 3, 1 : 1 + model.nq])


def in_a_process(code):
    """Exit code of Python code that has a `model` and `data` in motion, and what it wrote as errors."""
    start = f"""
        import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})
        import copy, gc, pickle, mujoco, rftsim, trees
        spec = trees.spec_of(); rftsim.add_sand(spec, trees.SAND); model = spec.compile()
        data = mujoco.MjData(model); data.qvel[2] = -1.0; mujoco.mj_step(model, data); assert data.sensordata[2] > 1.0
    """
    command = [sys.executable, "-X", "faulthandler", "-c", textwrap.dedent(start) + textwrap.dedent(code)]
    done = subprocess.run(command, env=CHECKED, capture_output=True, text=True, timeout=120)
    return done.returncode, done.stderr[-2000:]


def test_data_and_models_go_in_any_order():
    """Nothing is freed twice or used after it: the heap is checked at each release, see `test_memory`."""
    code = """
        def make():
            data = mujoco.MjData(model)
            mujoco.mj_step(model, data)
            return data
        data = make()
        more = [copy.copy(data) for _ in range(20)]
        mujoco.mj_resetData(model, data)
        mujoco.mj_copyData(more[0], model, data)
        mujoco.mj_step(model, more[0])
        last = more.pop()
        del data, more[::2]; gc.collect()
        data = make()
        del model; gc.collect()
        del more, data; gc.collect()
        model = last.model
        mujoco.mj_step(model, last)
        del model, last; gc.collect()
    """
    assert in_a_process(code) == (0, "")


def test_process_may_end_while_data_live():
    """mjData that outlive the package's modules are freed at exit by code that is still there."""
    code = """
        sys.data, sys.more, sys.model = data, copy.copy(data), copy.deepcopy(model)
        for name in [name for name in sys.modules if name.startswith("rftsim")]:
            del sys.modules[name]
        del rftsim; gc.collect(); mujoco.mj_step(model, data)
    """
    assert in_a_process(code) == (0, "")


def test_pickled_data():
    """Data can be pickled: a copy goes on alone, and both end cleanly."""
    code = """
        other = pickle.loads(pickle.dumps(data)); mujoco.mj_step(model, other); mujoco.mj_step(model, data)
        assert (other.qpos == data.qpos).all(); del data; gc.collect(); mujoco.mj_step(model, other)
    """
    assert in_a_process(code)[0] == 0


def test_model_survives_xml():
    """A spec with sand can be written as MJCF and read again, and the force is the same to the digits written."""
    code = """
        again = mujoco.MjModel.from_xml_string(spec.to_xml()); other = mujoco.MjData(again)
        other.qvel[2] = -1.0; mujoco.mj_step(again, other)
        assert abs(other.sensordata - data.sensordata).max() < 1e-3 * data.sensordata[2]
    """
    assert in_a_process(code)[0] == 0


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads the process's size from /proc")
@pytest.mark.parametrize("fresh", [True, False])
def test_copied_data_leak_nothing(model, fresh):
    """Copies into new data or old give back what they replace: the process keeps its size (a block is > 100 bytes)."""

    def pages():
        return int(Path("/proc/self/statm").read_text().split()[1])

    data, other, sizes = mujoco.MjData(model), mujoco.MjData(model), []
    for _ in range(2):
        for _ in range(2000 if fresh else 10000):
            copy.copy(data) if fresh else mujoco.mj_copyData(other, model, data)
        sizes.append(pages())
    assert sizes[1] - sizes[0] < (40 if fresh else 200)


def test_specs_are_copied_with_their_sand():
    """MjSpec.copy carries the sand."""
    spec = spec_of(BALL)
    add_sand(spec, SAND)
    data = [mujoco.MjData(s.compile()) for s in (spec, spec.copy())]
    for d in data:
        d.qvel[2] = -1.0
    np.testing.assert_array_equal(*[trajectory(d.model, d) for d in data])
