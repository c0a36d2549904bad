"""Sand under a MuJoCo model: the options, their checks, and the flow from them to the model's elements."""

import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, get_args

import mujoco
from numpy.typing import ArrayLike

from rftsim.engine import plugin
from rftsim.errors import RftsimNote, RftsimWarning, SceneError
from rftsim.law import layout
from rftsim.law.laws import Law, get_law
from rftsim.model import doubts, standing
from rftsim.model.draft import Draft, make_draft, name_bodies
from rftsim.model.drawing import check_drawing, write_drawing
from rftsim.model.economy import economise
from rftsim.model.felt import Choice, Felt, felt_bodies
from rftsim.model.floors import Floors, carrying, find_floors, floor_doubts, remove_floors, say_ground
from rftsim.model.geometry import Geoms, Meshes
from rftsim.model.marks import marks_for
from rftsim.model.planar import check_planar, plane_of
from rftsim.model.reach import slopes_of
from rftsim.model.readings import reading_doubts
from rftsim.model.shaping import Fineness
from rftsim.model.site import find_site
from rftsim.model.solution import check_solution
from rftsim.model.stale import mark
from rftsim.model.wheels import rolling
from rftsim.model.write import Carrier, check_bed, check_sensors, write_bed, write_sensors
from rftsim.reduction.reduce import Economy
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand
from rftsim.sand.presets import make_sand
from rftsim.sand.ruts import Ruts
from rftsim.sand.terrain import Terrain
from rftsim.surface.prints import prints_of
from rftsim.surface.triangles import Array, Surface, Wheel

REDUCTION: Final = 0.01
"""Largest error of a body's wrench for which its surface is reduced, unless the caller says otherwise [-]."""
WHOLE: Final[Mapping[str, Any]] = {"terrain": 0.0, "meshes": "exact", "reduction": 0.0}
"""Options of models that were made for sand: level at z = 0, every triangle felt, and meshes as they are."""
Force = Literal["implicit", "explicit"]
"""When the sand's force is taken: at the end of the step, or at the velocity of the moment."""


class Bed(NamedTuple):
    """Sand that was put under a model, and what feels it."""

    name: str
    """Name of its plugin instance."""
    sand: Sand
    """The medium."""
    law: Law
    """The law of its force."""
    terrain: "FreeSurface | Terrain"
    """The surface that bounds it from above."""
    surfaces: dict[str, Surface]
    """Surface of each body that feels the sand, by body name."""
    reasons: dict[str, str]
    """Why each body of the model does or does not feel it, by body name."""
    choices: tuple[str, ...]
    """Sentences that say what was chosen for the model, one for each kind."""
    notes: tuple[str, ...]
    """Sentences that say what was found doubtful or repaired, one for each kind."""
    economies: dict[str, Economy]
    """Numbers of the surfaces before and after they were reduced, by body name; empty at zero reduction."""


def add_sand(
    spec: mujoco.MjSpec,
    sand: "Sand | str | Mapping[str, Any]" = "poppy-seeds",
    law: "Law | str" = "rft3d",
    *,
    bodies: "Iterable[str] | str | None" = None,
    terrain: "FreeSurface | Terrain | float | str | None" = None,
    keep_floor: bool = False,
    ruts: "Ruts | bool" = False,
    plane: ArrayLike = (0.0, 1.0, 0.0),
    geoms: Geoms = "collision",
    meshes: Meshes = "hull",
    max_edge: float | None = None,
    reduction: float = REDUCTION,
    wheels: "Mapping[str, Wheel] | Iterable[str] | str" = (),
    sensors: bool = True,
    draw: bool = True,
    force: Force = "implicit",
    tolerance: float = layout.TOLERANCE,
    iterations: int = layout.ITERATIONS,
    name: str = "sand",
) -> Bed:
    """Put sand under a model that is not compiled yet, in the place of the floor that it stands on.

    Bodies without a name get one. Each body that feels the sand gets a sensor `<body>_sand` of its wrench: force, then
    moment about the body's origin, world frame. Choices are told as `RftsimNote`, doubts as `RftsimWarning`. The
    integrator RK4 gives way to implicitfast, unless the force is explicit.

    Args:
        spec: The model; changed in place.
        sand: The medium, see `make_sand`.
        law: A law, its name, or `rft3d:FILE.toml`, see `get_law`.
        bodies: Names of the bodies that feel the sand; by default each that can move and has geoms.
        terrain: The free surface of the sand; its height [m]; the name of a height field geom, which then is sand; or a
            text that names one, as `slope=10`, `dunes,amplitude=0.05` or `hill.png,size=8,high=0.5`, see
            `make_terrain`. By default that of the floor: the top of the plane, box or mesh, or the relief of the height
            field, that the model stands on at its first keyframe, or z = 0 where there is none.
        keep_floor: Leave the floors at the sand's level as they are. By default they lose their collision, and their
            contact pairs, and are hidden.
        ruts: Sand that remembers: where a body passes, the surface is lowered to what it swept, and what it displaced
            piles up beside it and slides to the angle of repose, which needs the sand's `mu_int`. `True` takes cells
            that fit the bodies, `Ruts` others.
        plane: Normal of the vertical plane of motion, for the 2D laws. Joints have to keep the bodies in it, as nothing
            would stop them across it.
        geoms: Which geoms bound a body: those that can collide, or `all`: where it has none of these, those it has.
        meshes: `hull`: geoms of meshes are felt as the convex hulls by which MuJoCo collides with them; `exact`: as
            they are. What is open is felt as its hull, and what collides with nothing as it is.
        max_edge: Longest edge of a triangle [m]; by default a sixth of each geom's size.
        reduction: Model only what the scene needs: the fewest elements whose wrench is that of all triangles within
            this share (see `rftsim.reduction`), in the poses and motions that the joints allow, and none of bodies that
            cannot reach the sand unless they are named in `bodies`. It holds for this sand, law and tree, and for each
            slope that a terrain has. Zero models every triangle of every body, also for a model that is attached to
            another, or whose sand is tilted later.
        wheels: Driven wheels, behind which the dynamic laws let the free surface drop: names, whose axis is then that
            of their hinge and whose radius that of their surface; or `Wheel` by name.
        sensors: Add the sensors.
        draw: Draw the free surface, as a plane or as height fields that collide with nothing.
        force: `implicit`: the sand's force at the end of each step, which holds at rest and at long steps; `explicit`:
            at the velocity of the moment.
        tolerance: Error of a body's velocity, relative, to which the implicit force is solved for in each step, 1e-6 to
            0.1. A smaller one costs iterations, and wins little where the step itself errs more; a larger one spares
            some.
        iterations: Most iterations of one such solution, 1 to 60, of one evaluation of every body's force or more each.
            What is not solved by then is taken as it is, and counted by `rftsim.work` as `unsolved`. A smaller number
            bounds the time of a step, a larger one lets hard steps end within the tolerance.
        name: Name of the bed, where a model has several.

    Returns:
        What was modelled.

    Raises:
        RftsimError: The scene cannot have sand: unknown bodies, surfaces that bound nothing, flags that would skip it,
            bodies that can leave the plane of a 2D law.
    """
    _check_choices(force, geoms, meshes, max_edge, reduction)
    _check_solution(tolerance, iterations)
    bed_sand, bed_law = make_sand(sand), get_law(law)
    check_bed(spec, name)
    draft = make_draft(spec)  # what is checked; the spec itself stays as it is until all is well
    _check_model(draft.model)
    site = find_site(draft, terrain)
    numbers = layout.pack_bed(bed_sand, bed_law, site.terrain, plane, tolerance=tolerance, iterations=iterations)
    choice = Choice(
        bodies=None if bodies is None else frozenset(_names(bodies)),
        fineness=Fineness(geoms, meshes, max_edge),
        plane=plane_of(numbers, bed_law, site.terrain),
        terrain=site.terrain if reduction and bodies is None else None,
    )
    felt = _felt(draft, choice, bed_law, wheels if isinstance(wheels, Mapping) else _names(wheels))
    marks = marks_for(draft.data, draft.model, felt.surfaces) if ruts is True else ruts or None
    whole = dict(felt.surfaces)
    economies = economise(draft.model, felt, numbers, reduction, slopes_of(site.terrain, choice.plane))
    floors = find_floors(draft.model, draft.data, site.terrain, max(s.size for s in felt.surfaces.values()))
    _check_names(spec, name, felt.surfaces if sensors else (), draw)
    if marks is not None:
        layout.remember(numbers, marks)
    packed = _packed(draft.model, felt, marks, whole)
    notes = [*_doubts(draft, bed_sand, numbers, packed, felt, floors), *(floor_doubts(floors) if keep_floor else ())]

    name_bodies(spec, draft)
    carrier = Carrier(name, plugin.IMPLICIT if force == "implicit" else plugin.EXPLICIT)
    write_bed(spec, carrier, numbers, packed)
    write_sensors(spec, carrier, felt.surfaces if sensors else ())
    if draw:
        write_drawing(spec, name, site.terrain, draft, marks)
    choices = [*felt.choices, *_integrate(spec, force)]
    if not keep_floor:
        choices = say_ground(site.field, floors, remove_floors(spec, floors)) + choices
    _tell(choices, notes)
    return Bed(
        name, bed_sand, bed_law, site.terrain, felt.surfaces, felt.reasons, tuple(choices), tuple(notes), economies
    )


def _felt(draft: Draft, choice: Choice, law: Law, wheels: "Mapping[str, Wheel] | Iterable[str]") -> Felt:
    """The bodies that feel the sand, some of them as wheels; those that can leave the plane of a law are refused."""
    felt = felt_bodies(draft.model, draft.data, choice)
    check_planar(draft.model, draft.data, felt.surfaces, law, choice.plane)
    wheeled = rolling(draft.model, felt.surfaces, wheels)
    felt.surfaces.update(wheeled if law.dynamic else {})
    return felt


def _integrate(spec: mujoco.MjSpec, force: str) -> list[str]:
    """Take an integrator that takes the implicit force; the line that says so, if it is another than before."""
    if force != "implicit" or spec.option.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        return []
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return ["the integrator is implicitfast now: RK4 would take the sand's force at the velocity of the moment"]


def _packed(model: mujoco.MjModel, felt: Felt, marks: Ruts | None, whole: Mapping[str, Surface]) -> dict[str, Array]:
    """The surfaces as numbers, with prints of the whole ones, marked with what they were made from, by body name."""
    packed = {
        name: layout.pack_surface(
            surface, None if marks is None else prints_of(whole[name], marks.spacing, layout.BLOCK)
        )
        for name, surface in felt.surfaces.items()
    }
    for name, numbers in packed.items():
        mark(model, model.body(name).id, numbers)
    return packed


def _doubts(
    draft: Draft, sand: Sand, bed: Array, surfaces: Mapping[str, Array], felt: Felt, floors: Floors
) -> list[str]:
    """The doubts about surfaces, gravity and sensors, and those that show when the model stands in its sand."""
    model = draft.model
    packed = {model.body(name).id: numbers for name, numbers in surfaces.items()}
    found = standing.stand(model, draft.data, standing.PackedBed(bed, packed, floors.terrain))
    return [
        *felt.doubts,
        *doubts.gravity_doubts(model, sand),
        *doubts.slope_doubts(model, sand, floors.terrain),
        *reading_doubts(model, packed),
        *doubts.sinkage_doubts(model, found, felt.surfaces),
        *doubts.footprint_doubts(model, found, floors.terrain),
        *carrying(model, found.qpos, floors),
    ]


def _tell(choices: Iterable[str], notes: Iterable[str]) -> None:
    for sentence in choices:
        warnings.warn(sentence, RftsimNote, stacklevel=3)
    for sentence in notes:
        warnings.warn(sentence, RftsimWarning, stacklevel=3)


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


def _check_choices(force: str, geoms: str, meshes: str, max_edge: float | None, reduction: float) -> None:
    for label, value, kind in (("force", force, Force), ("geoms", geoms, Geoms), ("meshes", meshes, Meshes)):
        if value not in get_args(kind):
            raise SceneError(f"{label} must be {' or '.join(map(repr, get_args(kind)))}, not {value!r}")
    if max_edge is not None and not max_edge > 0.0:
        raise SceneError(f"max_edge must be positive, not {max_edge:g}")
    if not 0.0 <= reduction < 1.0:
        raise SceneError(f"reduction must be zero, or below 1 as {REDUCTION} is, not {reduction:g}")


def _check_solution(tolerance: float, iterations: int) -> None:
    if tolerance == 0.0:
        raise SceneError(
            "tolerance is that of the implicit force, 1e-06 to 0.1, not 0; reduction=0 keeps every triangle"
        )
    check_solution(tolerance, iterations)


def _check_names(spec: mujoco.MjSpec, name: str, read: Iterable[str], draw: bool) -> None:
    """Refuse names that the sensors of bodies that are read, or the drawing of a bed, would have beside others."""
    check_sensors(spec, read)
    if draw:
        check_drawing(spec, name)


def _check_model(model: mujoco.MjModel) -> None:
    """Refuse flags under which MuJoCo would leave the sand out."""
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
