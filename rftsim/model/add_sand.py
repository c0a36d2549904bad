"""Sand under a MuJoCo model: the options, their checks, and the flow from them to the model's elements."""

import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from rftsim.engine import plugin
from rftsim.errors import RftsimWarning, SceneError
from rftsim.law import layout
from rftsim.law.laws import Law, get_law
from rftsim.model.draft import make_draft, name_bodies
from rftsim.model.economy import economise
from rftsim.model.felt import Choice, felt_bodies
from rftsim.model.floors import disable_floors, find_floors, floor_doubts
from rftsim.model.wheels import rolling
from rftsim.model.write import (
    Carrier,
    check_bed,
    check_drawing,
    check_sensors,
    write_bed,
    write_drawing,
    write_sensors,
)
from rftsim.reduction.reduce import Economy
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand
from rftsim.sand.presets import make_sand
from rftsim.surface.triangles import Surface, Wheel


class Bed(NamedTuple):
    """Sand that was put under a model, and what feels it."""

    name: str
    """Name of its plugin instance."""
    sand: Sand
    """The medium."""
    law: Law
    """The law of its force."""
    terrain: FreeSurface
    """The surface that bounds it from above."""
    surfaces: dict[str, Surface]
    """Surface of each body that feels the sand, by body name."""
    reasons: dict[str, str]
    """Why each body of the model does or does not feel it, by body name."""
    notes: tuple[str, ...]
    """Sentences that say what was found doubtful or repaired."""
    economies: dict[str, Economy]
    """Numbers of the surfaces before and after they were reduced, by body name; empty without a tolerance."""


def add_sand(
    spec: mujoco.MjSpec,
    sand: "Sand | str | Mapping[str, Any]" = "poppy-seeds",
    law: "Law | str" = "rft3d",
    *,
    bodies: "Iterable[str] | str | None" = None,
    terrain: "FreeSurface | float" = 0.0,
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
        terrain: The free surface of the sand, or its height [m].
        plane: Normal of the vertical plane of motion, for the 2D laws.
        geoms: Which geoms bound a body: those that can collide, or all.
        max_edge: Longest edge of a triangle [m]; by default a sixth of each geom's size.
        tolerance: Model only what the scene needs: the fewest elements whose wrench is that of all triangles within
            this share (see `rftsim.reduction`), in the poses and motions that the joints allow, and none of bodies that
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
    _check_choices(force, geoms, max_edge, tolerance)
    bed_sand, bed_law = make_sand(sand), get_law(law)
    terrain = terrain if isinstance(terrain, FreeSurface) else FreeSurface(height=terrain)
    numbers = layout.pack_bed(bed_sand, bed_law, terrain, plane)
    check_bed(spec, name)
    draft = make_draft(spec)  # what is checked; the spec itself stays as it is until all is well
    _check_model(draft.model, bed_sand)
    choice = Choice(
        bodies=None if bodies is None else frozenset(_names(bodies)),
        collision_only=geoms == "collision",
        max_edge=max_edge,
        allow_open=allow_open,
        plane=layout.record(numbers, layout.BED).plane if bed_law.planar else None,
        terrain=terrain if tolerance is not None and bodies is None else None,
    )
    felt = felt_bodies(draft.model, choice)
    wheeled = rolling(draft.model, felt.surfaces, wheels if isinstance(wheels, Mapping) else _names(wheels))
    if bed_law.dynamic:
        felt.surfaces.update(wheeled)
    economies = {} if tolerance is None else economise(draft.model, felt, numbers, tolerance)
    floors = find_floors(draft.model, felt.surfaces, terrain)
    if sensors:
        check_sensors(spec, felt.surfaces)
    if draw:
        check_drawing(spec, name)

    name_bodies(spec, draft)
    carrier = Carrier(name, plugin.IMPLICIT if force == "implicit" else plugin.EXPLICIT)
    write_bed(spec, carrier, numbers, felt.surfaces)
    if sensors:
        write_sensors(spec, carrier, felt.surfaces)
    if disable_floor:
        disable_floors(spec, floors)
    if draw:
        write_drawing(spec, name, terrain)
    notes = [note for surface in felt.surfaces.values() for note in surface.notes]
    notes += [] if disable_floor else floor_doubts(floors)
    for note in notes:
        warnings.warn(note, RftsimWarning, stacklevel=2)
    return Bed(name, bed_sand, bed_law, terrain, felt.surfaces, felt.reasons, tuple(notes), economies)


def load(
    source: "str | Path",
    sand: "Sand | str | Mapping[str, Any]" = "poppy-seeds",
    law: "Law | str" = "rft3d",
    **options: Any,
) -> mujoco.MjModel:
    """The compiled model of a file or an XML text with sand under it.

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
    """The uncompiled model of a file or of an XML text.

    Raises:
        SceneError: The file is missing.
    """
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return mujoco.MjSpec.from_string(source)
    if not Path(source).is_file():
        raise SceneError(f"no model file {source}")
    return mujoco.MjSpec.from_file(str(source))


def _names(names: Iterable[str]) -> Iterable[str]:
    """Names of bodies, of which one may stand alone."""
    return [names] if isinstance(names, str) else names


def _check_choices(force: str, geoms: str, max_edge: float | None, tolerance: float | None) -> None:
    if force not in ("explicit", "implicit"):
        raise SceneError(f"force must be 'implicit' or 'explicit', not {force!r}")
    if geoms not in ("collision", "all"):
        raise SceneError(f"geoms must be 'collision' or 'all', not {geoms!r}")
    if max_edge is not None and not max_edge > 0.0:
        raise SceneError(f"max_edge must be positive, not {max_edge:g}")
    if tolerance is not None and not 0.0 < tolerance < 1.0:
        raise SceneError(f"tolerance must lie between 0 and 1, as 0.01 does, not {tolerance:g}")


def _check_model(model: mujoco.MjModel, sand: Sand) -> None:
    """Refuse flags under which MuJoCo would leave the sand out, and warn of another gravity than the sand's."""
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
