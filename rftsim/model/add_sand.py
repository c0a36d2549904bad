"""Sand under a MuJoCo model: what is modelled, and the MJCF elements that carry it."""

import dataclasses
import difflib
import functools
import math
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from rftsim.engine import block as engine
from rftsim.engine import plugin
from rftsim.errors import RftsimWarning, SceneError
from rftsim.law import layout
from rftsim.law.laws import Law, get_law
from rftsim.model.geometry import body_surface, is_colliding
from rftsim.model.reach import clearance, sampled_reach, stays_in_plane
from rftsim.reduction import reduce
from rftsim.reduction.reduce import Economy
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand
from rftsim.sand.presets import make_sand
from rftsim.surface.triangles import Array, Surface, Wheel

_GEOM = mujoco.mjtGeom
SAND_RGBA = (1.0, 1.0, 1.0, 0.6)
GRAIN_RGB = ((0.78, 0.72, 0.52), (0.66, 0.59, 0.41))


class Bed(NamedTuple):
    """Sand that was put under a model, and what feels it."""

    name: str
    sand: Sand
    law: Law
    free_surface: FreeSurface
    surfaces: dict[str, Surface]
    """Surface of each body that feels the sand, by body name."""
    reasons: dict[str, str]
    """Why each body of the model does or does not feel it, by body name."""
    notes: tuple[str, ...]
    """What was found doubtful or repaired."""
    economies: dict[str, Economy]
    """What the surfaces were reduced to, by body name; empty without a tolerance."""


def add_sand(
    spec: mujoco.MjSpec,
    sand: "Sand | str | Mapping[str, Any]" = "poppy-seeds",
    law: "Law | str" = "rft3d",
    *,
    bodies: "Iterable[str] | str | None" = None,
    surface: "FreeSurface | float" = 0.0,
    plane: ArrayLike = (0.0, 1.0, 0.0),
    geoms: Literal["collision", "all"] = "collision",
    max_edge: float | None = None,
    tolerance: float | None = None,
    wheels: "Mapping[str, Wheel] | Iterable[str] | str" = (),
    disable_floor: bool = False,
    allow_open: bool = False,
    sensors: bool = True,
    draw: bool = True,
    force: Literal["implicit", "explicit"] = "implicit",
    name: str = "sand",
) -> Bed:
    """Put sand under a model that is not compiled yet.

    Bodies without a name get one. Each body that feels the sand gets a sensor `<body>_sand` of its wrench: force, then
    moment about the body's origin, world frame.

    Args:
        spec: The model; changed in place.
        sand: The medium, see `make_sand`.
        law: A law, its name, or `rft3d:FILE.toml`, see `get_law`.
        bodies: Names of the bodies that feel the sand; by default each that can move and has geoms.
        surface: The free surface, or its height [m].
        plane: Normal of the vertical plane of motion, for the 2D laws.
        geoms: Which geoms bound a body: those that can collide, or all.
        max_edge: Longest edge of a triangle [m]; by default a sixth of each geom's size.
        tolerance: Model only what the scene needs: the fewest elements whose wrench is that of all triangles within
            this share (see `rftsim.economy`), in the poses and motions that the joints allow, and none of bodies that
            cannot reach the sand unless they are named in `bodies`. It holds for this sand, law and tree; so a model
            that is attached to another, or whose sand is tilted later, needs none (None).
        wheels: Driven wheels, behind which the dynamic laws let the free surface drop: names, whose axis is then that
            of their hinge and whose radius that of their surface; or `Wheel` by name.
        disable_floor: Take collision from planes at the sand's level, which would support the bodies a second time.
        allow_open: Accept meshes that are not closed.
        sensors: Add the sensors.
        draw: Draw the free surface as a translucent plane.
        force: `implicit`: the sand's force at the end of each step, which holds at rest and at long steps; `explicit`:
            at the velocity of the moment, which the integrator RK4 takes in any case.
        name: Name of the bed, where a model has several.

    Returns:
        What was modelled.

    Raises:
        RftsimError: The scene cannot have sand: unknown bodies, surfaces that bound nothing, flags that would skip it.
    """
    if force not in ("explicit", "implicit"):
        raise SceneError(f"force must be 'implicit' or 'explicit', not {force!r}")
    if geoms not in ("collision", "all"):
        raise SceneError(f"geoms must be 'collision' or 'all', not {geoms!r}")
    if max_edge is not None and not max_edge > 0.0:
        raise SceneError(f"max_edge must be positive, not {max_edge:g}")
    if tolerance is not None and not 0.0 < tolerance < 1.0:
        raise SceneError(f"tolerance must lie between 0 and 1, as 0.01 does, not {tolerance:g}")
    bodies = [bodies] if isinstance(bodies, str) else bodies
    wheels = [wheels] if isinstance(wheels, str) else wheels
    plugin_name = plugin.IMPLICIT if force == "implicit" else plugin.EXPLICIT
    bed_sand, bed_law = make_sand(sand), get_law(law)
    free_surface = surface if isinstance(surface, FreeSurface) else FreeSurface(height=surface)
    numbers = layout.pack_sand(bed_sand, bed_law, free_surface, plane)
    if name in {instance.name for instance in spec.plugins}:
        raise SceneError(f"the model has a plugin instance {name!r} already: give this bed another name")
    draft = spec.copy()  # what is checked; the spec itself stays as it is until all is well
    names = _name_elements(draft)
    model = draft.compile()
    _check_options(model, bed_sand)
    plane_normal = numbers[7:10] if bed_law.planar else None
    within = free_surface if tolerance is not None and bodies is None else None
    surfaces, reasons = _surfaces(model, bodies, geoms == "collision", max_edge, allow_open, plane_normal, within)
    rolling = _with_wheels(model, surfaces, wheels)
    if bed_law.dynamic:
        surfaces |= rolling
    economies = {} if tolerance is None else _reduce(model, surfaces, reasons, numbers, tolerance)
    notes = [note for one in surfaces.values() for note in one.notes]
    floors = _floors(model, surfaces, free_surface)
    _check_names(spec, name, surfaces, sensors, draw)
    for body, body_name in zip(spec.bodies, names, strict=True):
        body.name = body_name
    for geom, depth in floors.items():
        if disable_floor:
            place = geom.removeprefix(_TEMPORARY)
            element = spec.geom(geom) if place == geom else spec.geoms[int(place)]
            element.contype = element.conaffinity = 0
        else:
            notes.append(
                f"{_shown(geom)} lies {depth:.3g} m below the sand's surface and collides: it supports the bodies a "
                "second time. Take its collision away (disable_floor=True) or lower it"
            )
    _write(spec, plugin_name, name, numbers, surfaces, sensors)
    if draw:
        _draw(spec, name, free_surface)
    for note in notes:
        warnings.warn(note, RftsimWarning, stacklevel=2)
    return Bed(name, bed_sand, bed_law, free_surface, surfaces, reasons, tuple(notes), economies)


def load(
    source: "str | Path",
    sand: "Sand | str | Mapping[str, Any]" = "poppy-seeds",
    law: "Law | str" = "rft3d",
    **options: Any,
) -> mujoco.MjModel:
    """A compiled model with sand under it.

    Args:
        source: Path of an MJCF or URDF file, or the XML itself.
        sand: The medium, see `make_sand`.
        law: A law, its name, or `rft3d:FILE.toml`, see `get_law`.
        **options: Those of `add_sand`.

    Raises:
        RftsimError: The file is missing, or the scene cannot have sand.
        ValueError: MuJoCo cannot compile the model.
    """
    spec = read_spec(source)
    add_sand(spec, sand, law, **options)
    return spec.compile()


def read_spec(source: "str | Path") -> mujoco.MjSpec:
    """A model from a path or from XML.

    Raises:
        SceneError: The file is missing.
    """
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return mujoco.MjSpec.from_string(source)
    if not Path(source).is_file():
        raise SceneError(f"no model file {source}")
    return mujoco.MjSpec.from_file(str(source))


CLEAR = 0.1
"""Height over the sand, over the body's size, from which on a body counts as out of reach."""


def _reduce(
    model: mujoco.MjModel, surfaces: dict[str, Surface], reasons: dict[str, str], numbers: Array, tolerance: float
) -> dict[str, Economy]:
    """Replace surfaces by the fewest elements that keep the tolerance, and say so in the reasons."""
    economies = {}
    for name, surface in surfaces.items():
        body = model.body(name).id
        reach = functools.partial(sampled_reach, model, body, surface)
        surfaces[name], found = reduce.reduced(surface, numbers, tolerance, reach)
        economies[name] = found
        if found.elements < found.triangles:
            said = f"{found.elements} elements keep its wrench within {100 * found.error:.2g} %"
        elif found.triangles <= layout.BLOCK:
            said = f"one block of {layout.BLOCK} already, the least that the implicit force's derivative takes"
        else:
            said = f"no fewer elements found that keep its wrench within {100 * tolerance:g} %"
        reasons[name] += f"; {said}"
    return economies


_TEMPORARY = "rftsim-geom:"


def _name_elements(draft: mujoco.MjSpec) -> list[str]:
    """Name the bodies that have no name, and geoms that have none after their place in the spec; the bodies' names."""
    taken = {body.name for body in draft.bodies}
    for number, body in enumerate(draft.bodies):
        if not body.name:
            body.name = next(n for k in range(len(taken) + 1) if (n := f"body{number + k}") not in taken)
            taken.add(body.name)
    for number, geom in enumerate(draft.geoms):
        geom.name = geom.name or f"{_TEMPORARY}{number}"
    return [body.name for body in draft.bodies]


def _shown(geom: str) -> str:
    return f"geom {geom.removeprefix(_TEMPORARY)}"


def _check_names(spec: mujoco.MjSpec, name: str, surfaces: Mapping[str, Surface], sensors: bool, draw: bool) -> None:
    taken = {sensor.name for sensor in spec.sensors} & {f"{body}_sand" for body in surfaces} if sensors else set()
    if taken:
        raise SceneError(f"the model has a sensor {min(taken)!r} already: rename it, or pass sensors=False")
    drawn = [("geom", spec.geoms), ("texture", spec.textures), ("material", spec.materials)]
    for kind, elements in drawn if draw else ():
        if f"{name}_surface" in {element.name for element in elements}:
            raise SceneError(f"the model has a {kind} '{name}_surface' already: rename it, or pass draw=False")


def _check_options(model: mujoco.MjModel, sand: Sand) -> None:
    spring, damper = mujoco.mjtDisableBit.mjDSBL_SPRING, mujoco.mjtDisableBit.mjDSBL_DAMPER
    if model.opt.disableflags & spring and model.opt.disableflags & damper:
        raise SceneError(
            'the model has <flag spring="disable" damper="disable"/>, with which MuJoCo skips all passive forces, the '
            "sand's too: enable one of them"
        )
    if model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
        raise SceneError(
            'the model has <flag sleep="enable"/>, under which sand would pile up on sleeping bodies: disable it'
        )
    gravity = float(np.linalg.norm(model.opt.gravity))
    if abs(gravity - sand.g) > 0.02 * sand.g:
        warnings.warn(
            f"the model's gravity is {gravity:.3g} m/s^2 and the sand's strength belongs to {sand.g:.3g}: if the sand "
            f"is under the model's gravity, pass sand.replace(g={gravity:.4g}), which scales it",
            RftsimWarning,
            stacklevel=3,
        )


def _surfaces(
    model: mujoco.MjModel,
    bodies: Iterable[str] | None,
    collision_only: bool,
    max_edge: float | None,
    allow_open: bool,
    plane: Array | None,
    within: FreeSurface | None,
) -> tuple[dict[str, Surface], dict[str, str]]:
    """Surfaces by body name, and reasons; bodies that cannot reach the free surface `within`, if given, have none."""
    names = [model.body(i).name for i in range(model.nbody)]
    chosen = None if bodies is None else set(bodies)
    for unknown in sorted((chosen or set()) - set(names)):
        near = difflib.get_close_matches(unknown, names, 3, 0.0)
        raise SceneError(f"no body {unknown!r}; near are {', '.join(near)}")
    surfaces: dict[str, Surface] = {}
    reasons: dict[str, str] = {}
    for i, name in enumerate(names):
        if i == 0:
            if chosen is not None and name in chosen:
                raise SceneError(f"{name!r} is the world, which cannot move: name bodies that can")
            continue
        if chosen is not None and name not in chosen:
            reasons[name] = "not among the bodies asked for"
            continue
        if model.body_weldid[i] == 0:
            reasons[name] = "cannot move"
        elif model.body_plugin[i] >= 0:
            reasons[name] = "has another plugin, or sand already"
        else:
            found = body_surface(model, i, collision_only=collision_only, max_edge=max_edge, allow_open=allow_open)
            if found is None:
                reasons[name] = "has no geom that collides" if model.body_geomnum[i] else "has no geom"
            elif within is not None and (above := clearance(model, i, found, within)) > CLEAR * found.size:
                reasons[name] = f"stays {above:.3g} m or more above the sand, by its tree and its joints' ranges"
            else:
                felt, reasons[name] = _felt(model, i, found, plane)
                surfaces[name] = felt.clustered(layout.BLOCK)
                continue
        if chosen is not None:
            raise SceneError(f"body {name!r} cannot feel the sand: it {reasons[name]}")
    if not surfaces:
        found_none = "; ".join(f"{name}: {reason}" for name, reason in reasons.items()) or "the model has no bodies"
        raise SceneError(
            f"no body would feel the sand ({found_none}). Bodies need geoms that collide, or geoms='all'; "
            '<compiler discardvisual="true"/> deletes the others'
        )
    return surfaces, reasons


def _felt(model: mujoco.MjModel, body: int, surface: Surface, plane: Array | None) -> tuple[Surface, str]:
    """What of a surface can feel the sand, and why.

    Under a planar law, faces parallel to the plane of motion carry nothing; where the body cannot turn out of that
    plane they never will.
    """
    everything = f"moves, {surface.ntri} triangles"
    if plane is None or not stays_in_plane(model, body, plane):
        return surface, everything
    carries = np.abs(surface.normals @ plane) < 1.0 - 1e-6
    if carries.all() or not carries.any():
        return surface, everything
    return (
        dataclasses.replace(surface, triangles=surface.triangles[carries]),
        f"moves in the plane; {np.count_nonzero(~carries)} of {surface.ntri} triangles are parallel to it and left out",
    )


def _with_wheels(
    model: mujoco.MjModel, surfaces: Mapping[str, Surface], wheels: "Mapping[str, Wheel] | Iterable[str]"
) -> dict[str, Surface]:
    named = dict(wheels) if isinstance(wheels, Mapping) else dict.fromkeys(wheels)
    found = {}
    for name, wheel in named.items():
        if name not in surfaces:
            raise SceneError(f"wheel {name!r} does not feel the sand; bodies that do are {', '.join(surfaces)}")
        found[name] = dataclasses.replace(surfaces[name], wheel=wheel or _hinged_wheel(model, name, surfaces[name]))
    return found


def _hinged_wheel(model: mujoco.MjModel, name: str, surface: Surface) -> Wheel:
    body = model.body(name)
    for joint in range(body.jntadr[0], body.jntadr[0] + body.jntnum[0]):
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
            axis, centre = model.jnt_axis[joint], model.jnt_pos[joint]
            reach = surface.corners - centre
            radius = float(np.linalg.norm(reach - np.outer(reach @ axis, axis), axis=1).max())
            return Wheel(tuple(axis.tolist()), tuple(centre.tolist()), radius)
    raise SceneError(f"wheel {name!r} has no hinge to turn about: give its Wheel(axis, centre, radius)")


def _floors(model: mujoco.MjModel, surfaces: Mapping[str, Surface], free_surface: FreeSurface) -> dict[str, float]:
    """Planes and height fields that would support the bodies a second time, and how deep they lie [m]."""
    reach = max(surface.size for surface in surfaces.values())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = {}
    for geom in range(model.ngeom):
        kind = _GEOM(model.geom_type[geom])
        if kind not in (_GEOM.mjGEOM_PLANE, _GEOM.mjGEOM_HFIELD) or not is_colliding(model, geom):
            continue
        depth = float(free_surface.offset - np.dot(free_surface.normal, data.geom_xpos[geom]))
        if model.body_weldid[model.geom_bodyid[geom]] == 0 and abs(depth) <= reach:
            found[model.geom(geom).name] = depth
    return found


def _write(
    spec: mujoco.MjSpec, plugin_name: str, name: str, numbers: Array, surfaces: Mapping[str, Surface], sensors: bool
) -> None:
    spec.activate_plugin(plugin_name)
    instance = spec.add_plugin(name=name, plugin_name=plugin_name, active=True)
    spec.add_numeric(name=engine.SAND_MARKER + name, data=numbers, size=numbers.size)
    for body_name, surface in surfaces.items():
        body = spec.body(body_name)
        _attach(body.plugin, instance)
        data = layout.pack_surface(surface)
        for first in range(0, data.size, engine.CHUNK):
            chunk = data[first : first + engine.CHUNK]
            more = f"{first // engine.CHUNK}-" if first else ""
            spec.add_numeric(name=more + engine.BODY_MARKER + body_name, data=chunk, size=chunk.size)
        if sensors:
            sensor = spec.add_sensor(
                name=f"{body_name}_sand",
                type=mujoco.mjtSensor.mjSENS_PLUGIN,
                objtype=mujoco.mjtObj.mjOBJ_BODY,
                objname=body_name,
            )
            _attach(sensor.plugin, instance)


def _attach(element: Any, instance: Any) -> None:
    element.name, element.plugin_name, element.active = instance.name, instance.plugin_name, True


def _draw(spec: mujoco.MjSpec, name: str, free_surface: FreeSurface) -> None:
    normal = free_surface.normal
    half = 0.5 * math.acos(min(normal[2], 1.0))
    length = math.hypot(normal[0], normal[1]) or 1.0
    quat = [math.cos(half), -math.sin(half) * normal[1] / length, math.sin(half) * normal[0] / length, 0.0]
    spec.add_texture(
        name=f"{name}_surface",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        mark=mujoco.mjtMark.mjMARK_RANDOM,
        random=0.15,
        rgb1=GRAIN_RGB[0],
        markrgb=GRAIN_RGB[1],
        width=64,
        height=64,
    )
    grains = spec.add_material(name=f"{name}_surface", texrepeat=[4, 4], texuniform=True)
    grains.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = f"{name}_surface"
    spec.worldbody.add_geom(
        name=f"{name}_surface",
        type=_GEOM.mjGEOM_PLANE,
        size=[0, 0, 0.1],
        pos=[0, 0, free_surface.height],
        quat=quat,
        contype=0,
        conaffinity=0,
        material=f"{name}_surface",
        rgba=SAND_RGBA,
    )
