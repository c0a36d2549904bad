"""The MJCF elements of a bed of sand: the plugin and the numbers that carry it, and its sensors."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import mujoco

from rftsim.engine import block as engine
from rftsim.engine import seal
from rftsim.errors import SceneError
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
        bed: Packed sand.
        surfaces: Packed surface of each body that feels the sand, by body name.
    """
    spec.activate_plugin(carrier.plugin)
    spec.add_plugin(name=carrier.name, plugin_name=carrier.plugin, active=True)
    numbers = seal.sealed_bed(bed, carrier.name)
    spec.add_numeric(name=engine.SAND_MARKER + carrier.name, data=numbers, size=numbers.size)
    for body, data in surfaces.items():
        _attach(spec.body(body).plugin, carrier)
        numbers = seal.sealed_surface(data, body, carrier.name)
        for first in range(0, numbers.size, engine.CHUNK):
            chunk = numbers[first : first + engine.CHUNK]
            marker = f"{engine.MORE_MARKER}{first // engine.CHUNK}:" if first else engine.BODY_MARKER
            spec.add_numeric(name=marker + body, data=chunk, size=chunk.size)


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
