"""Models and data that reach another process: pickled where nothing was imported, or by file where slots differ."""

import json
import pickle
import subprocess
import sys
import textwrap
from multiprocessing import get_context

import mujoco
import numpy as np
import pytest
from trees import sandy, shaken, spec_of, trajectory

from rftsim import SceneError, wrenches
from rftsim.engine import pickles

OTHER_FIRST = """
    import ctypes, mujoco
    from pathlib import Path
    library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco*"))))
    other = ctypes.create_string_buffer(512)
    library.mjp_defaultPlugin(other)
    name = ctypes.create_string_buffer(b"test.other")
    ctypes.c_void_p.from_buffer(other).value = ctypes.addressof(name)
    print("slot", library.mjp_registerPlugin(other))
    import rftsim
"""


def in_fresh_process(code, *arguments):
    """Exit code and output of Python code in a process that has imported nothing of ours."""
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, arguments)], capture_output=True, text=True, timeout=120
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("kind", ["model", "data"])
def test_pickles_bring_the_plugin_along(kind, tmp_path):
    """A process that knows only pickle and mujoco steps as this one does, under both forces."""
    models = [sandy(force=force) for force in ("explicit", "implicit")]
    path = tmp_path / "kept"
    path.write_bytes(pickle.dumps(models if kind == "model" else [shaken(model) for model in models]))
    code = """
        import pickle, sys, mujoco
        for kept in pickle.load(open(sys.argv[1], "rb")):
            data = mujoco.MjData(kept) if isinstance(kept, mujoco.MjModel) else kept
            data.qvel[:] = -0.5
            for _ in range(3): mujoco.mj_step(data.model, data)
            print(repr(data.sensordata.tolist()))
    """
    status, said = in_fresh_process(code, path)
    assert status == 0, said
    for model, kept, line in zip(models, pickle.loads(path.read_bytes()), said.splitlines(), strict=True):
        own = mujoco.MjData(model) if kind == "model" else kept
        own.qvel[:] = -0.5
        np.testing.assert_array_equal(json.loads(line), trajectory(model, own, 3)[-1, model.nq :])


def stepped(model):
    """Called in a spawned worker, which imports this module and so mujoco alone before it has the model."""
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 3)
    return data.qpos.tolist()


def test_models_without_sand_are_pickled_as_ever():
    """What has no sand needs no rftsim where it is read."""
    model = spec_of().compile()
    assert b"rftsim" not in pickle.dumps(model)
    assert b"rftsim" in pickle.dumps(sandy())
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(model)).geom_size, model.geom_size)


def test_spawned_workers():
    """A model goes to a spawned worker as an argument."""
    model = sandy(force="implicit")
    with get_context("spawn").Pool(1) as pool:
        assert pool.apply(stepped, (model,)) == stepped(model)


def test_pickles_of_other_slots_are_refused():
    """A slot that another plugin has here is said, instead of run."""
    kind, state, slots = pickles._reduced(sandy())[1]
    (slot,) = slots
    with pytest.raises(SceneError, match=r"'other.plugin' by its slot \d+, which is rftsim.sand in this process"):
        pickles.restore(kind, state, {slot: "other.plugin"})
    with pytest.raises(SceneError, match="slot 99, which is empty"):
        pickles.restore(kind, state, {99: "rftsim.sand"})


def test_binary_model_where_another_plugin_came_first(tmp_path):
    """The implicit model's slot is the explicit plugin's there: it is refused, as the state has the wrong size."""
    path = tmp_path / "model.mjb"
    mujoco.mj_saveModel(sandy(force="implicit"), str(path))
    code = textwrap.dedent(OTHER_FIRST) + textwrap.dedent("""
        import sys
        model = mujoco.MjModel.from_binary_path(sys.argv[1])
        try:
            data = mujoco.MjData(model)
        except mujoco.FatalError as error:
            print("refused:", error)
    """)
    status, said = in_fresh_process(code, path)
    assert status == 0, said
    assert "refused: rftsim's plugin cannot take bed 'sand': it was made for the other force" in said


@pytest.mark.parametrize("force", ["explicit", "implicit"])
def test_reset_of_unpickled_data_leaves_the_original_alone(force):
    """MuJoCo copies the number of a block bit by bit: it is the other data's, and nothing of theirs is cleared."""
    model = sandy(force=force)
    data = shaken(model)
    before = wrenches(model, data).force.copy()
    assert before.any()
    other = pickle.loads(pickle.dumps(data))
    mujoco.mj_resetData(other.model, other)
    np.testing.assert_array_equal(wrenches(model, data).force, before)
