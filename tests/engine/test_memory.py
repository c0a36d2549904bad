"""Memory: nothing is read or written out of bounds, and nothing is kept that nobody needs."""

import subprocess
import sys
import textwrap
from pathlib import Path

import mujoco
import pytest
from checked import CHECKED
from trees import sandy

SCENE = f"""
    import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})
    import copy, ctypes, gc, mmap, mujoco, numpy as np, pickle, rftsim, trees
    from rftsim.engine import layout
    def make(force):
        bodies = trees.tree(np.random.default_rng(3), ["free", "hinge", "none"])
        model = trees.sandy(bodies, terrain=0.1, force=force, law="drft3d")
        data = mujoco.MjData(model); data.qvel[:] = -0.5
        return model, data
"""
GUARDED = """
    def guard(model, from_below):
        # the model's numbers, moved to pages between pages that nobody may touch
        libc, size, page = ctypes.CDLL(None, use_errno=True), 8 * model.nnumericdata, mmap.PAGESIZE
        pages = -(-size // page) * page
        libc.mmap.restype = ctypes.c_void_p
        libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
        libc.mprotect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
        start = libc.mmap(None, pages + 2 * page, mmap.PROT_READ | mmap.PROT_WRITE, 0x22, -1, 0)
        inner = start + page if from_below else start + page + pages - size
        ctypes.memmove(inner, model.numeric_data.ctypes.data, size)
        for end in (start, start + page + pages):
            assert libc.mprotect(end, page, 0) == 0
        ctypes.c_void_p.from_address(model._address + layout.layout()[0].numeric_data).value = inner
        return inner, inner + size
"""


def run(code, **environment):
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env=CHECKED | environment,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=300,
    )
    return done.returncode, (done.stdout + done.stderr)[-3000:]


linux = pytest.mark.skipif(sys.platform != "linux", reason="guards pages as Linux does")


@linux
@pytest.mark.parametrize("from_below", [True, False])
def test_no_number_outside_the_model_is_read(from_below):
    """All of numeric_data lies against a page that nobody may read, at its lower or upper end."""
    code = (
        textwrap.dedent(SCENE)
        + textwrap.dedent(GUARDED)
        + textwrap.dedent(f"""
        for force in ("explicit", "implicit"):
            model, data = make(force)
            guard(model, {from_below})
            for _ in range(30): mujoco.mj_step(model, data)
            assert np.abs(data.sensordata).max() > 1.0
            other = mujoco.MjData(model); twin = copy.copy(data)
            mujoco.mj_step(model, other); mujoco.mj_step(model, twin)
    """)
    )
    assert run(code) == (0, "")


@linux
@pytest.mark.parametrize("from_below", [True, False])
def test_the_guard_holds(from_below):
    """One number before or behind the same memory is one too many."""
    code = (
        textwrap.dedent(SCENE)
        + textwrap.dedent(GUARDED)
        + textwrap.dedent(f"""
        low, high = guard(make("explicit")[0], {from_below})
        assert np.isfinite(ctypes.c_double.from_address(low).value + ctypes.c_double.from_address(high - 8).value)
        ctypes.c_double.from_address({"low - 8" if from_below else "high"}).value
    """)
    )
    assert run(code)[0] == -11


def test_blocks_are_not_overrun():
    """Steps, copies, resets and releases under an allocator that looks at the bytes around each block."""
    code = textwrap.dedent(SCENE) + textwrap.dedent("""
        for force in ("explicit", "implicit"):
            model, data = make(force)
            for _ in range(30): mujoco.mj_step(model, data)
            more = [copy.copy(data) for _ in range(4)]
            model.body_plugin[1] = -1
            mujoco.mj_copyData(more[0], model, data); mujoco.mj_resetData(model, more[1])
            for each in more: mujoco.mj_step(model, each)
            del more, data; gc.collect()
    """)
    assert run(code) == (0, "")


@pytest.mark.parametrize("fault", ["beyond", "twice", "after"])
def test_the_allocator_sees_faults(fault):
    """A byte beyond a block, a second release, and a look at what was released that finds it whole, end a process."""
    code = f"""
        import ctypes
        take, release = ctypes.pythonapi.PyMem_RawMalloc, ctypes.pythonapi.PyMem_RawFree
        take.restype, take.argtypes, release.argtypes = ctypes.c_void_p, [ctypes.c_size_t], [ctypes.c_void_p]
        block = take(64)
        if {fault!r} == "beyond": ctypes.c_char.from_address(block + 64).value = b"x"
        ctypes.memmove(block + 16, b"unharmed", 8)
        release(block)
        if {fault!r} == "twice": release(block)
        if {fault!r} == "after": assert bytes((ctypes.c_char * 8).from_address(block + 16)) == b"unharmed"
    """
    assert run(code)[0] != 0


def resident():
    """Pages of this process in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1])


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads the process's size from /proc")
@pytest.mark.parametrize("force", ["explicit", "implicit"])
def test_soak(force):
    """1e5 creations and 1e6 resets, of both forces, with steps between: the process stays as large as at the start."""
    model, sizes = sandy(force=force, max_edge=0.08), []
    data = mujoco.MjData(model)
    for _ in range(10):
        for _ in range(5_000):
            mujoco.MjData(model)
        for k in range(50_000):
            mujoco.mj_resetData(model, data)
            if k % 100 == 0:
                mujoco.mj_step(model, data)
        sizes.append(resident())
    assert max(sizes[1:]) - sizes[0] < 200, sizes  # a block is larger than 100 bytes: a leak is over 1000 pages
