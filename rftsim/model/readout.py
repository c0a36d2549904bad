"""The sand's action on a model's bodies, read from the model and its data."""

import weakref
from typing import Any, NamedTuple

import mujoco
import numpy as np

from rftsim.engine import seal
from rftsim.engine.block import (
    BODY_MARKER,
    MORE_MARKER,
    MORE_TERRAIN_MARKER,
    SAND_MARKER,
    TERRAIN_MARKER,
    read_block,
)
from rftsim.errors import SceneError
from rftsim.law import evaluate, layout
from rftsim.model.stale import fingerprint, tell_stale
from rftsim.surface.triangles import Array


class Wrenches(NamedTuple):
    """The sand's action on each body of a model, world frame; zero on bodies that do not feel it."""

    force: Array
    """[N], shape (nbody, 3)."""
    moment: Array
    """About the body's origin, `data.xpos` [N m], shape (nbody, 3)."""
    power: Array
    """Power of the sand on the body [W], shape (nbody,); negative where it resists."""


class Tractions(NamedTuple):
    """The sand's action on each triangle of a body, world frame."""

    centre: Array
    """Centroid [m], shape (ntri, 3)."""
    normal: Array
    """Outward normal, shape (ntri, 3)."""
    area: Array
    """[m^2], shape (ntri,)."""
    depth: Array
    """Effective depth of the centroid [m], shape (ntri,); negative above the sand."""
    stress: Array
    """Traction [Pa], shape (ntri, 3)."""
    active: "np.ndarray[tuple[int], np.dtype[np.bool_]]"
    """Submerged and leading, shape (ntri,)."""


class Instance(NamedTuple):
    """A bed of sand in a compiled model."""

    id: int
    """Plugin instance."""
    name: str
    start: int
    """Where its sand starts in the model's numeric_data."""
    packed: Array
    """Its sand as numbers, see `bed`; a view of the model's numeric_data."""
    bodies: dict[int, Array]
    """Packed surface of each body that feels it, by body id; a view."""
    relief: Array | None = None
    """Its packed terrain, where its surface is no plane; a view, whose place and heights may be changed in place."""

    @property
    def whole(self) -> Array:
        """Its sand and its terrain as packed numbers, see `layout.pack_bed`."""
        return self.packed if self.relief is None else np.concatenate([self.packed, self.relief])

    @property
    def bed(self) -> Any:
        """The sand's parameters by name, `layout.BED`: xi_n, mu_surf, rho_c, ...; writing one changes the sand."""
        return layout.record(self.packed, layout.BED)

    def beds_in(self, numeric_data: Array) -> Any:
        """The same of many simulations, from their numeric_data, (n, nnumericdata): an array of `layout.BED`, (n,)."""
        numbers = numeric_data[:, self.start : self.start + self.packed.size]
        return numbers.view(layout.BED)[:, 0]


def instances(model: mujoco.MjModel) -> list[Instance]:
    """The beds of sand in a model.

    Raises:
        SceneError: Numbers of a bed or a surface are missing, or were changed to what none can be.
    """
    by_name = {model.numeric(i).name: i for i in range(model.nnumeric)}
    found: dict[int, dict[int, Array]] = {}
    for body in np.flatnonzero(model.body_plugin >= 0):
        surface = _surface(model, by_name, model.body(int(body)).name)
        if surface is not None:
            found.setdefault(int(model.body_plugin[body]), {})[int(body)] = surface
    return [_instance(model, by_name, instance, bodies) for instance, bodies in found.items()]


def _instance(model: mujoco.MjModel, by_name: dict[str, int], instance: int, bodies: dict[int, Array]) -> Instance:
    """The bed of a plugin instance that bodies name."""
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_PLUGIN, instance) or ""
    marked = _marked(by_name, SAND_MARKER, name)
    numbers = None if marked is None else _numeric(model, by_name[marked])
    if marked is None or numbers is None or numbers.size != layout.BED_NUMBERS + seal.SEAL_NUMBERS:
        raise SceneError(f"the model lacks the numbers of its bed {name!r}: make it anew with rftsim.add_sand")
    packed, behind = numbers[: layout.BED_NUMBERS], numbers[layout.BED_NUMBERS :]
    if not any(seal.is_sealed(packed[seal.SEALED], behind, own) for own in seal.own_names(name, behind)):
        raise SceneError(f"the law of bed {name!r}, or its numbers' place, was changed: make the model anew")
    relief = None
    if layout.record(packed, layout.BED).relief:
        relief = _relief(model, by_name, name)
        if relief is None:
            raise SceneError(f"the model lacks the terrain of its bed {name!r}: make it anew with rftsim.add_sand")
    return Instance(instance, name, int(model.numeric_adr[by_name[marked]]), packed, bodies, relief)


def _marked(by_name: dict[str, int], marker: str, owner: str) -> str | None:
    """The name of the numeric that is an owner's with a marker in it."""
    names = (owner[:start] + marker + owner[start:] for start in range(len(owner) + 1))
    return next((name for name in names if name in by_name), None)


def _numeric(model: mujoco.MjModel, i: int) -> Array:
    start = max(int(model.numeric_adr[i]), 0)
    view: Array = model.numeric_data[start : start + max(int(model.numeric_size[i]), 0)]
    return view


def _going_on(model: mujoco.MjModel, by_name: dict[str, int], marker: str, more: str, owner: str) -> Array | None:
    """The numbers of an owner that go on behind its first numeric, seal and all; None where it has none."""
    first = _marked(by_name, marker, owner)
    if first is None:
        return None
    i = by_name[first]
    places = [k for k in range(len(owner) + 1) if owner[:k] + marker + owner[k:] == first]
    end = max(_end(by_name, i, owner[:k] + more, owner[k:]) for k in places)
    start, size = max(int(model.numeric_adr[i]), 0), int(model.numeric_size[i:end].sum())
    numbers: Array = model.numeric_data[start : start + max(size, 0)]
    return numbers


def _relief(model: mujoco.MjModel, by_name: dict[str, int], owner: str) -> Array | None:
    """The packed terrain of a bed; None where it has none, or it is not whole."""
    numbers = _going_on(model, by_name, TERRAIN_MARKER, MORE_TERRAIN_MARKER, owner)
    size = 0 if numbers is None else numbers.size - seal.SEAL_NUMBERS
    if numbers is None or size < layout.TERRAIN_NUMBERS:
        return None
    head = layout.record(numbers, layout.TERRAIN)
    fits = 2.0 <= head.rows <= size and 2.0 <= head.columns <= size and layout.terrain_size(head) == size
    return numbers[:size] if fits else None


def _surface(model: mujoco.MjModel, by_name: dict[str, int], owner: str) -> Array | None:
    """The packed surface of a body; None where it has none."""
    numbers = _going_on(model, by_name, BODY_MARKER, MORE_MARKER, owner)
    if numbers is None:
        return None
    size = numbers.size - seal.SEAL_NUMBERS
    header = layout.record(numbers, layout.HEADER) if size > layout.HEADER_NUMBERS else None
    if header is None or not 1.0 <= header.ntri <= size or layout.packed_size(header) != size:
        raise SceneError(f"the surface of body {owner!r} was changed in the model: make it anew with rftsim.add_sand")
    return numbers[:size]


def _end(by_name: dict[str, int], i: int, before: str, after: str) -> int:
    """The numeric behind those of what starts at i and goes on, with so much of its names on both sides of a number."""
    end = i + 1
    while by_name.get(f"{before}{end - i}:{after}") == end:
        end += 1
    return end


_known: "weakref.WeakKeyDictionary[mujoco.MjModel, tuple[Any, list[int]]]" = weakref.WeakKeyDictionary()
"""Of each model the numbers that it had when it was looked at, and the ids of its beds."""


def _looked_at(model: mujoco.MjModel) -> list[int]:
    """Ids of a model's beds, which are looked at anew, and their doubts told, where the model's numbers changed."""
    numbers, known = fingerprint(model), _known.get(model)
    if known is None or known[0] != numbers:
        beds = instances(model)
        tell_stale(model, [item for bed in beds for item in bed.bodies.items()])
        known = _known[model] = numbers, [bed.id for bed in beds]
    return known[1]


def wrenches(model: mujoco.MjModel, data: mujoco.MjData) -> Wrenches:
    """Force and moment of the sand on each body, as found in the last mj_forward or mj_step of `data`.

    The explicit force is applied as it is. The implicit one is that at the end of the step, or its mean over the parts
    of a split one; what MuJoCo is handed then is the generalised force that ends the step in the same place.
    """
    force, moment = np.zeros((model.nbody, 3)), np.zeros((model.nbody, 3))
    for bed in _looked_at(model):
        block = read_block(data.plugin_data, data._address, bed)
        force[block.bodies], moment[block.bodies] = block.wrenches[:, :3], block.wrenches[:, 3:]
    velocity, omega = body_velocities(model, data)
    return Wrenches(force, moment, np.einsum("ij,ij->i", force, velocity) + np.einsum("ij,ij->i", moment, omega))


def tractions(model: mujoco.MjModel, data: mujoco.MjData, body: "int | str") -> Tractions:
    """The sand on each triangle of a body, at the positions and velocities of the last mj_forward or mj_step.

    Raises:
        SceneError: The body does not feel sand.
    """
    index = model.body(body).id
    for bed in instances(model):
        if index in bed.bodies:
            break
    else:
        raise SceneError(f"body {model.body(index).name!r} does not feel sand")
    surface = bed.bodies[index]
    tell_stale(model, [(index, surface)])
    _check_seal(model, bed, index)
    velocity, omega = body_velocities(model, data)
    rotation = data.xmat[index].reshape(3, 3)
    stress, depth = evaluate.triangle_stresses(
        bed.whole, surface, data.xpos[index], data.xmat[index], velocity[index], omega[index]
    )
    *columns, area = layout.read_columns(surface)
    centre, normal = np.array(columns[:3]).T, np.array(columns[3:]).T
    return Tractions(
        centre=centre @ rotation.T + data.xpos[index],
        normal=normal @ rotation.T,
        area=area,
        depth=depth,
        stress=stress @ rotation.T,
        active=evaluate.acts(bed.packed, normal, rotation, stress, depth),
    )


def _check_seal(model: mujoco.MjModel, bed: Instance, body: int) -> None:
    """Refuse a surface of which a number was changed."""
    owner, surface, numbers = model.body(body).name, bed.bodies[body], model.numeric_data
    start = (surface.ctypes.data - numbers.ctypes.data) // 8 + surface.size
    behind, of_bed = numbers[start : start + seal.SEAL_NUMBERS], numbers[bed.start + layout.BED_NUMBERS :]
    names = (own + name for own in seal.own_names(owner, behind) for name in seal.own_names(bed.name, of_bed))
    if not any(seal.is_sealed(surface, behind, name) for name in names):
        raise SceneError(f"the surface of body {owner!r} was changed in the model: make it anew with rftsim.add_sand")


def body_velocities(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, Array]:
    """Velocity of each body's origin and angular velocity, world frame, (nbody, 3) each."""
    omega = data.cvel[:, :3]  # MuJoCo's cvel: angular first
    arm = data.xpos - data.subtree_com[model.body_rootid]
    return data.cvel[:, 3:] + np.cross(omega, arm), omega


class Work(NamedTuple):
    """The cost of the implicit force since the data was made or reset."""

    steps: int
    evaluations: int
    """Evaluations of every body's force."""
    derivatives: int
    """Evaluations of the derivative of every body's force, each worth two to five of the force."""
    unsolved: int
    """Equations whose solution stayed outside the tolerance; the best found was taken."""


_TOTALS = ("steps", "all_evaluations", "all_derivatives", "all_unsolved")


def work(model: mujoco.MjModel, data: mujoco.MjData) -> Work:
    """The cost of the sand so far, summed over the beds."""
    totals = np.zeros(4, dtype=int)
    for bed in instances(model):
        counters = read_block(data.plugin_data, data._address, bed.id).counters
        totals += np.array([counters[name] for name in _TOTALS], dtype=int)
    steps, *costs = totals.tolist()
    return Work(steps, *costs)
