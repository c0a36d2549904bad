"""The MJCF elements of a bed of sand: the plugin and the numbers that carry it, and its sensors."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import mujoco

from rftsim.engine import block as engine
from rftsim.engine import seal
from rftsim.engine.plugin import RUTS
from rftsim.errors import SceneError
from rftsim.law.layout import BED, BED_NUMBERS, record, ruts_size
from rftsim.surface.triangles import Array


class Carrier(NamedTuple):
    """The plugin instance that carries a bed of sand, and the name of its plugin."""

    name: str
    plugin: str


def check_bed(spec: mujoco.MjSpec, name: str) -> None:
    """Refuse a bed's name that a plugin instance has already.

    Raises:
        SceneError: The name is taken.
    """
    if name in {instance.name for instance in spec.plugins}:
        raise SceneError(f"the model has a plugin instance {name!r} already: give this bed another name")


def check_sensors(spec: mujoco.MjSpec, bodies: Iterable[str]) -> None:
    """Refuse bodies for whose wrench a sensor's name is taken.

    Raises:
        SceneError: The model has such a sensor.
    """
    taken = {sensor.name for sensor in spec.sensors} & {_sensor(body) for body in bodies}
    if taken:
        raise SceneError(f"the model has a sensor {min(taken)!r} already: rename it, or pass sensors=False")


def write_bed(spec: mujoco.MjSpec, carrier: Carrier, bed: Array, surfaces: Mapping[str, Array]) -> None:
    """Put a bed of sand and the surfaces of bodies into a spec.

    Args:
        spec: The model; every body that feels the sand has its name.
        carrier: The plugin instance that is made.
        bed: Packed sand, with its terrain where it has one.
        surfaces: Packed surface of each body that feels the sand, by body name.
    """
    spec.activate_plugin(carrier.plugin)
    own, terrain = bed[:BED_NUMBERS], bed[BED_NUMBERS:]
    size = int(ruts_size(record(own, BED)))
    instance = spec.add_plugin(name=carrier.name, plugin_name=carrier.plugin, active=True)
    if size:
        instance.config = {RUTS: str(size)}
    _write(spec, engine.SAND_MARKER, "", carrier.name, seal.sealed_bed(own, carrier.name))
    if terrain.size:
        numbers = seal.sealed_terrain(terrain, carrier.name)
        _write(spec, engine.TERRAIN_MARKER, engine.MORE_TERRAIN_MARKER, carrier.name, numbers)
    for body, data in surfaces.items():
        _attach(spec.body(body).plugin, carrier)
        _write(
            spec, engine.BODY_MARKER, engine.MORE_MARKER, body, seal.sealed_surface(data, body, carrier.name)
        )  # fmt: skip


def _write(spec: mujoco.MjSpec, marker: str, more: str, owner: str, numbers: Array) -> None:
    """Put numbers into numerics that are named after their owner, the first by a marker and the others by another."""
    for first in range(0, numbers.size, engine.CHUNK):
        chunk = numbers[first : first + engine.CHUNK]
        name = (f"{more}{first // engine.CHUNK}:" if first else marker) + owner
        spec.add_numeric(name=name, data=chunk, size=chunk.size)


def write_sensors(spec: mujoco.MjSpec, carrier: Carrier, bodies: Iterable[str]) -> None:
    """Add a sensor of the sand's wrench on each body: force, then moment, world frame."""
    for body in bodies:
        sensor = spec.add_sensor(
            name=_sensor(body), type=mujoco.mjtSensor.mjSENS_PLUGIN, objtype=mujoco.mjtObj.mjOBJ_BODY, objname=body
        )
        _attach(sensor.plugin, carrier)


def _sensor(body: str) -> str:
    return f"{body}_sand"


def _attach(plugin: Any, carrier: Carrier) -> None:
    plugin.name, plugin.plugin_name, plugin.active = carrier.name, carrier.plugin, True
