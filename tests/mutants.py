"""Models whose files, arrays or edits in place are not what was written, and what becomes of them in a process."""

import contextlib
import copy
import faulthandler
import os
import pickle
import select
import signal
import warnings
from typing import NamedTuple
from xml.etree import ElementTree

import mujoco
import numpy as np
from trees import BALL, SAND, tree

from rftsim import add_sand, instances, tractions, wrenches
from rftsim.engine.seal import FREE
from rftsim.sand.medium import PARAMETERS

ODD = (np.nan, np.inf, -np.inf, 1e9, 1e6, -1.0, 0.0, 0.5, 3.0, 1e308, 5e-324, -1e300)
STEPS = 5
PATIENCE = 60.0
"""Seconds that a process may take."""


class Base(NamedTuple):
    """A model with sand, as XML and compiled."""

    xml: str
    model: mujoco.MjModel


class Outcome(NamedTuple):
    """What became of a mutant: `refused`, `flagged`, `right` or `wrong`, or the signal that ended it, and why."""

    kind: str
    said: str


def bases():
    """Models of two bodies and one bed or two, under both forces, of several numerics to a surface."""
    found = []
    for force in ("explicit", "implicit"):
        spec = mujoco.MjSpec.from_string(
            f"<mujoco><worldbody>{tree(np.random.default_rng(11), ['free', 'hinge'])}</worldbody></mujoco>"
        )
        add_sand(spec, SAND, terrain=0.1, force=force, reduction=0.0)
        model = spec.compile()
        found.append(Base(spec.to_xml(), model))
    two = mujoco.MjSpec.from_string(
        f"<mujoco><worldbody>{BALL}{BALL.replace('ball', 'other').replace('.02', '.5')}</worldbody></mujoco>"
    )
    add_sand(two, SAND, bodies=["ball"], force="explicit", reduction=0.0)
    add_sand(two, SAND.replace(xi_n=1e5), bodies=["other"], name="second", force="explicit", reduction=0.0, terrain=0.5)
    found.append(Base(two.to_xml(), two.compile()))
    return found


def moved(model, data, steps=STEPS):
    """Set a state in the sand, and step; positions, velocities and sensors of each step."""
    data.qpos[:], data.qvel[:] = model.qpos0, -0.5
    rows = []
    for _ in range(steps):
        mujoco.mj_step(model, data)
        rows.append(np.concatenate([data.qpos, data.qvel, data.sensordata]))
    return np.array(rows)


def mutant(base, rng):
    """A base, mutated as the generator draws: its kind, what makes the model, and what edits it later."""
    kinds = [*XML_EDITS, *MODEL_EDITS, *FILE_EDITS, *(f"late {name}" for name in LATE_EDITS)]
    kind = str(rng.choice(kinds))
    seed = int(rng.integers(1 << 31))
    if kind in XML_EDITS:
        return kind, lambda: _from_xml(base, XML_EDITS[kind], np.random.default_rng(seed)), None
    if kind in FILE_EDITS:
        return kind, lambda: _from_file(base, FILE_EDITS[kind], np.random.default_rng(seed)), None
    if kind in MODEL_EDITS:
        return kind, lambda: _edited(base, MODEL_EDITS[kind], np.random.default_rng(seed)), None
    edit = LATE_EDITS[kind.removeprefix("late ")]
    return kind, lambda: copy.copy(base.model), lambda model: edit(model, np.random.default_rng(seed))


def lives(base, kind, make, later):
    """Run a mutant here; its outcome."""
    try:
        model = make()
        data = mujoco.MjData(model)
        if later is not None:
            moved(model, data, 2)
            later(model)
            mujoco.mj_resetData(model, data)
        found = moved(model, data)
        flagged = _is_flagged(data)
        if later is None:
            _read_all(model, data, flagged)
    except (ValueError, mujoco.FatalError) as error:
        is_ours = "rftsim" in str(error)  # what MuJoCo says of XML may take two lines
        return Outcome("wrong" if is_ours and "\n" in str(error).strip() else "refused", str(error))
    if later is not None:
        _copies_are_safe(model, data)
    if flagged:
        return Outcome("flagged", "")
    wanted = moved(*_like(base, model, kind in XML_EDITS))
    shared = slice(None) if found.shape == wanted.shape else slice(model.nq + model.nv)  # where a sensor was taken away
    error = np.abs(found[:, shared] - wanted[:, shared]).max() / np.abs(wanted[:, shared]).max()
    return Outcome("right" if error <= 1e-9 else "wrong", f"{error:.3g}")


def _read_all(model, data, flagged):
    """Copy the data, and read what the sand does; an error of one sentence is an answer."""
    twin = copy.copy(data)
    mujoco.mj_step(model, twin)
    mujoco.mj_resetData(model, twin)
    if not flagged:
        wrenches(model, data)
        for bed in instances(model):
            for body in bed.bodies:
                tractions(model, data, body)


def _copies_are_safe(model, data):
    """Copies after an edit in place, and what is read of them, end no process; that they are refused is an answer."""
    with contextlib.suppress(ValueError, mujoco.FatalError):
        _read_all(model, data, False)


def _is_flagged(data):
    return any(data.warning.number) or not np.isfinite(data.qacc).all()


def _like(base, model, is_printed):
    """The base, with those numbers of its beds that may be changed in place as the model has them, and its data.

    What names the other force in XML is of that force.
    """
    clean = mujoco.MjModel.from_xml_string(base.xml) if is_printed else copy.copy(base.model)
    if is_printed and model.plugin_statenum.any() != clean.plugin_statenum.any():
        text = base.xml.replace('plugin="rftsim.sand"', 'plugin="other"').replace("rftsim.sand.implicit", "rftsim.sand")
        clean = mujoco.MjModel.from_xml_string(text.replace('plugin="other"', 'plugin="rftsim.sand.implicit"'))
    with contextlib.suppress(ValueError):  # of places that were edited late, which nobody reads again
        beds = {bed.name: bed.bed for bed in instances(model)}
        for own in instances(clean):
            for name in (*FREE, *PARAMETERS) if own.name in beds else ():
                own.bed[name] = beds[own.name][name]
    return clean, mujoco.MjData(clean)


def in_process(function, *arguments):
    """The outcome of a function in a forked process of its own."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():  # that other threads may hold locks: the child takes none of theirs
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        _silently(lambda: os.write(writing, pickle.dumps(function(*arguments))))
    os.close(writing)
    ready, _, _ = select.select([reading], [], [], PATIENCE)
    if not ready:
        os.kill(child, signal.SIGKILL)
    with os.fdopen(reading, "rb") as pipe:
        text = pipe.read()
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status) or not text:
        return Outcome(f"signal {os.WTERMSIG(status)}", "" if ready else f"after {PATIENCE} s")
    return pickle.loads(text)


def _silently(work):
    """Do something in a child, whose log goes nowhere, and end it at once."""
    faulthandler.disable()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    os.dup2(nowhere, 1)
    os.chdir(os.environ.get("TMPDIR", "/tmp"))
    code = 1
    try:
        work()
        code = 0
    finally:
        os._exit(code)


def _from_xml(base, edit, rng):
    root = ElementTree.fromstring(base.xml)
    edit(root, rng)
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))


def _edited(base, edit, rng):
    model = copy.copy(base.model)
    edit(model, rng)
    return model


def _from_file(base, edit, rng):
    size = mujoco.mj_sizeModel(base.model)
    buffer = np.empty(size, np.uint8)
    mujoco.mj_saveModel(base.model, None, buffer)
    return mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": bytes(edit(base.model, buffer, rng))})


def _numerics(root, rng=None):
    found = [each for each in root.iter("numeric") if "rftsim" in each.get("name")]
    return found if rng is None else found[int(rng.integers(len(found)))]


def _numbers(root, rng):
    each = _numerics(root, rng)
    return each, each.get("data").split()


def _xml_number(root, rng):
    each, numbers = _numbers(root, rng)
    k = int(rng.integers(len(numbers)))
    numbers[k] = repr(float(rng.choice([1e9, 1e6, -1.0, 0.0, 2.5, float(numbers[k]) * 1.01, -float(numbers[k])])))
    each.set("data", " ".join(numbers))


def _xml_cut(root, rng):
    each, numbers = _numbers(root, rng)
    kept = numbers[: int(rng.integers(1, len(numbers)))] if len(numbers) > 1 else numbers
    each.set("data", " ".join(kept))
    each.set("size", str(len(kept)))


def _xml_longer(root, rng):
    each, numbers = _numbers(root, rng)
    each.set("size", str(min(len(numbers) + int(rng.integers(1, 9)), 500)))
    each.set("data", " ".join([*numbers, "1", "2"][:500]))


def _xml_shift(root, rng):
    each, numbers = _numbers(root, rng)
    each.set("data", " ".join(numbers[1:] + numbers[:1]))


def _xml_order(root, rng):
    custom = root.find("custom")
    children = list(custom)
    for child in children:
        custom.remove(child)
    shuffled = children[::-1] if rng.random() < 0.5 else [children[k] for k in rng.permutation(len(children))]
    custom.extend(shuffled)


def _xml_swap_names(root, rng):
    one, other = _numerics(root, rng), _numerics(root, rng)
    mine, its = one.get("name"), other.get("name")
    one.set("name", its)
    other.set("name", mine)


def _xml_rename(root, rng):
    each = _numerics(root, rng)
    name = each.get("name")
    each.set("name", rng.choice([name + "x", "x" + name, name.replace(":", ""), name.replace("rftsim", "rft")]))


def _xml_foreign(root, rng):
    custom = root.find("custom")
    more = ElementTree.Element("numeric", name="foreign", data="1 2 3")
    custom.insert(int(rng.integers(len(custom) + 1)), more)


def _xml_drop(root, rng):
    root.find("custom").remove(_numerics(root, rng))


def _xml_plugin(root, rng):
    """Take the plugin from a body or a sensor, or let it name the other force, or another bed."""
    own = [each for each in root.iter("plugin") if each.get("instance")]
    parents = {child: parent for parent in root.iter() for child in parent}
    choice = rng.random()
    each = own[int(rng.integers(len(own)))]
    if choice < 0.4:
        parents[each].remove(each)
    elif choice < 0.7:
        for one in root.iter("plugin"):
            if one.get("plugin"):
                is_implicit = one.get("plugin").endswith("implicit")
                one.set("plugin", "rftsim.sand" if is_implicit else "rftsim.sand.implicit")
    else:
        each.set("instance", rng.choice([one.get("instance") for one in own]))


XML_EDITS = {
    "number": _xml_number,
    "cut": _xml_cut,
    "longer": _xml_longer,
    "shifted": _xml_shift,
    "order": _xml_order,
    "names swapped": _xml_swap_names,
    "renamed": _xml_rename,
    "foreign": _xml_foreign,
    "dropped": _xml_drop,
    "plugins": _xml_plugin,
}


def _one_number(model, rng):
    numbers = model.numeric_data
    k = int(rng.integers(numbers.size))
    numbers[k] = rng.choice([*ODD, numbers[k] * 1.001, -numbers[k]])


def _header(model, rng):
    """Change a number of a surface's header: the count of triangles, a corner of its box, a wheel."""
    bed = instances(model)[int(rng.integers(len(instances(model))))]
    surface = bed.bodies[int(rng.choice(list(bed.bodies)))]
    surface[int(rng.choice([14, 14, *range(22)]))] = rng.choice([*ODD, 2.0, 1e3])


def _of_bed(model, rng):
    bed = instances(model)[int(rng.integers(len(instances(model))))]
    bed.packed[int(rng.integers(bed.packed.size))] = rng.choice(ODD)


def _run_of_numbers(model, rng):
    """Zero, reverse, scale or shift a run of numbers."""
    numbers = model.numeric_data
    start = int(rng.integers(numbers.size - 1))
    run = numbers[start : start + int(rng.integers(2, 600))]
    edits = (lambda x: 0.0 * x, lambda x: x[::-1].copy(), lambda x: 1.5 * x, lambda x: np.roll(x, 1))
    run[:] = edits[int(rng.integers(len(edits)))](run.copy())


def _place(model, rng):
    array = (model.numeric_adr, model.numeric_size)[int(rng.integers(2))]
    array[int(rng.integers(array.size))] = rng.choice([-1, 0, 1, 7, 499, 10**6, 2**31 - 1, -(2**31)])


def _body_plugin(model, rng):
    felt = np.flatnonzero(model.body_plugin >= 0)
    model.body_plugin[int(rng.choice(felt))] = rng.choice([-1, model.nplugin - 1])


def _slot(model, rng):
    model.plugin[:] = rng.permutation([model.plugin[0], model.plugin[0] ^ 1])[0]


def _state_place(model, rng):
    array = (model.plugin_stateadr, model.plugin_statenum)[int(rng.integers(2))]
    array[int(rng.integers(array.size))] = rng.choice([-1, 0, 1, 5, 10**6, 2**31 - 1])


def _name_place(model, rng):
    array = (model.name_numericadr, model.name_bodyadr)[int(rng.integers(2))]
    array[int(rng.integers(array.size))] = rng.integers(len(model.names))  # beyond them MuJoCo itself reads on


_NUMBERS = {"one number": _one_number, "header": _header, "bed": _of_bed, "run": _run_of_numbers}
MODEL_EDITS = {
    **_NUMBERS,
    "place": _place,
    "body_plugin": _body_plugin,
    "slot": _slot,
    "state's place": _state_place,
    "name's place": _name_place,
}
LATE_EDITS = {**_NUMBERS, "place": _place, "body_plugin": _body_plugin, "slot": _slot, "name's place": _name_place}


def _flip(model, buffer, rng):
    """Flip a bit of the numbers, wherever they lie in the file."""
    start = bytes(buffer).index(model.numeric_data.tobytes())
    buffer[start + int(rng.integers(8 * model.nnumericdata))] ^= 1 << int(rng.integers(8))
    return buffer


def _cut_file(model, buffer, rng):
    return buffer[: int(rng.integers(buffer.size))]


FILE_EDITS = {"flipped": _flip, "cut file": _cut_file}
