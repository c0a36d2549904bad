"""Scenes that come with rftsim: a model, the sand under it, and what is measured of it."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import mujoco
from rftsim_models import intruder, wheels

from rftsim.errors import SceneError
from rftsim.model.add_sand import WHOLE, Bed, add_sand, read_spec
from rftsim.run.robot import trunk
from rftsim.sand.medium import Sand
from rftsim.sand.presets import PRESETS
from rftsim.surface.triangles import Wheel, load_surface

Settings = Mapping[str, float | str]
"""Settings of a scene by name."""


class Measured(NamedTuple):
    """The body that a scene is measured by, and how."""

    body: str
    """The body whose speed and sinkage are meant."""
    wheel_radius: float | None
    """Outer radius where the body is a wheel about y [m]: its sinkage is then radius less axle height, and it slips."""
    robot: bool = False
    """Whether the body is the trunk of a robot: the sinkage is then that of its deepest body, the force that on all."""


@dataclasses.dataclass(frozen=True)
class Scene:
    """A scene that comes with rftsim, as its model is built from its settings."""

    says: str
    """A line that says what the scene is."""
    settings: Settings
    """The settings that `--set` changes, with their defaults."""
    build: Callable[[Settings], mujoco.MjSpec]
    """Makes the model from the settings."""
    sand: Sand
    """The medium, where no other is asked for."""
    law: str
    """Name of the law, where no other is asked for."""
    duration: float
    """How long it runs, where nothing else is asked for [s]."""
    wheel: Callable[[Settings], wheels.WheelParameters] | None = None
    """Gives the parameters of its wheel from the settings; None where it has no wheel."""
    structural: bool = False
    """Whether the free surface drops behind the wheel under the dynamic laws."""


class Start(NamedTuple):
    """The state in which a scene starts."""

    keyframe: str | None = None
    """Name or number of the keyframe; by default the first, or the initial state where there is none."""
    settle: bool = False
    """Whether what floats is lowered or raised until the sand carries it."""


class Staged(NamedTuple):
    """A scene with its sand, compiled and ready to run."""

    model: mujoco.MjModel
    """Compiled, with sand."""
    bed: Bed
    """The sand, and what feels it."""
    measured: Measured
    """The body that it is measured by."""
    duration: float
    """How long it runs [s]."""
    start: Start = Start()
    """How it starts."""


def _grouser_wheel(settings: Settings) -> wheels.WheelParameters:
    return dataclasses.replace(wheels.GROUSER_WHEEL, felt_height=float(settings["felt_height"]))


def _half_wheel(settings: Settings) -> wheels.WheelParameters:
    return dataclasses.replace(wheels.HALF_GROUSER_WHEEL, felt_height=float(settings["felt_height"]))


def _runner(settings: Settings) -> wheels.WheelParameters:
    return wheels.FOUR_FLAP_RUNNER


def _wheel_scene(
    says: str, parameters: Callable[[Settings], wheels.WheelParameters], settings: Settings, **rest: Any
) -> Scene:
    def build(chosen: Settings) -> mujoco.MjSpec:
        return wheels.build_wheel(parameters(chosen), float(chosen["rpm"]))

    return Scene(says=says, settings=settings, build=build, wheel=parameters, **rest)


def _intruder(settings: Settings) -> mujoco.MjSpec:
    if settings["mesh"] == "sphere":
        import trimesh  # not at start-up, which it would slow by a second

        mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.05)
        vertices, faces = mesh.vertices, mesh.faces
    else:
        surface = load_surface(str(settings["mesh"]), scale=float(settings["scale"]))
        vertices, faces = surface.triangles.reshape(-1, 3), range(3 * surface.ntri)
    numbers = {name: float(settings[name]) for name in ("density", "height", "speed", "rate")}
    return intruder.build_intruder(vertices, list(faces), motion=settings["motion"], **numbers)  # type: ignore[arg-type]


POPPY: Final = PRESETS["poppy-seeds"]
"""The sand of the shipped scenes, and of model files where no other is asked for."""
FILE_LAW: Final = "rft3d"
"""The law of model files where no other is asked for."""
FILE_START: Final = Start(settle=True)
"""The start of model files where nothing else is asked for."""
FILE_DURATION: Final = 4.0
"""How long model files run where nothing else is asked for [s]."""

MOST_STEPS: Final = 1e9
"""Most time steps of a run; a thousand million take hours at the least."""
LEAST_STEP: Final = 1e-9
"""Least time step [s]; shorter ones are lost in the rounding of time."""

SCENES: Final[Mapping[str, Scene]] = {
    "grouser-wheel": _wheel_scene(
        "[Agarwal] Table 4.1: grousered wheel on a gravity-compensated carriage, 4 N forward, rate imposed",
        _grouser_wheel,
        {"rpm": 60.0, "felt_height": 1 / 3},
        sand=POPPY,
        law="drft2d",
        duration=4.0,
        structural=True,
    ),
    "half-grouser-wheel": _wheel_scene(
        "[Agarwal] appendix B.1: the same at half the size",
        _half_wheel,
        {"rpm": 90.0, "felt_height": 1 / 3},
        sand=POPPY,
        law="drft2d",
        duration=4.0,
        structural=True,
    ),
    "four-flap-runner": _wheel_scene(
        "[Agarwal] Table 4.3: four-flap runner, rate imposed, lambda 4",
        _runner,
        {"rpm": 100.0},
        sand=POPPY.replace(lambda_=4.0),
        law="drft2d",
        duration=4.0,
    ),
    "intruder": Scene(
        "a mesh dropped, dragged or drilled: motion=drop|drag|drill, mesh=FILE",
        {"mesh": "sphere", "scale": 1.0, "motion": "drop", "density": 1500.0, "height": 0.1, "speed": 0.1, "rate": 0.0},
        _intruder,
        sand=POPPY,
        law="rft3d",
        duration=1.0,
    ),
}
"""Every shipped scene by name."""


def stage(
    name: str,
    *,
    sand: "Sand | str | None" = None,
    law: str | None = None,
    settings: Mapping[str, str] | None = None,
    timestep: float | None = None,
    duration: float | None = None,
    start: Start = FILE_START,
    **options: Any,
) -> Staged:
    """A shipped scene, or somebody's MJCF, with its sand, compiled.

    Args:
        name: A scene's name, or the path of an MJCF file.
        sand: Sand instead of the scene's.
        law: Law instead of the scene's.
        settings: Changes of the scene's settings.
        timestep: Time step instead of the model's [s].
        duration: Duration instead of the scene's [s].
        start: How a model file starts; shipped scenes have a start of their own.
        **options: Further options of `add_sand`; None stands for its own choice, or the scene's.

    Raises:
        RftsimError: No such scene, file or setting, or the scene cannot have sand.
    """
    options = {option: value for option, value in options.items() if value is not None}
    scene, wheel = SCENES.get(name), None
    if scene is None:
        spec = _read(name, settings or {})
    else:
        spec, wheel = _built(name, scene, _chosen(name, scene.settings, settings or {}))
        options = {**WHOLE, **options}
    if timestep is not None:
        spec.option.timestep = timestep
    _check_positive("duration", duration)
    _check_positive("timestep", spec.option.timestep)
    if spec.option.timestep < LEAST_STEP:
        raise SceneError(f"the timestep must be {LEAST_STEP:g} s or more, not {spec.option.timestep:g} s")
    if wheel is not None:
        options.setdefault("max_edge", 2 * wheel.width)  # as fine as the outline was asked to be
        if scene is not None and scene.structural:
            options["wheels"] = {wheels.WHEEL: Wheel((0, 1, 0), (0, 0, 0), wheel.outer_radius)}
    if sand is None:
        sand = scene.sand if scene else POPPY
    bed = add_sand(spec, sand, law or (scene.law if scene else FILE_LAW), **options)
    model = spec.compile()
    if scene is None:
        measured = Measured(trunk(model, [model.body(name).id for name in bed.surfaces]), None, robot=True)
    elif wheel is None:
        measured = Measured(intruder.INTRUDER, None)
    else:
        measured = Measured(wheels.WHEEL, wheel.outer_radius)
    duration = duration or (scene.duration if scene else FILE_DURATION)
    if duration > MOST_STEPS * model.opt.timestep:
        raise SceneError(f"{duration:g} s are more than {MOST_STEPS:g} time steps of {model.opt.timestep:g} s")
    return Staged(model, bed, measured, duration, Start() if scene else start)


def _read(name: str, settings: Mapping[str, str]) -> mujoco.MjSpec:
    """The model of a file, which has no settings."""
    if not Path(name).is_file():
        raise SceneError(f"no scene or model file {name!r}; scenes are {', '.join(SCENES)}")
    if settings:
        raise SceneError(f"{name} is a model file and has no settings; --set is for {', '.join(SCENES)}")
    return read_spec(name)


def _built(name: str, scene: Scene, chosen: Settings) -> tuple[mujoco.MjSpec, wheels.WheelParameters | None]:
    """The model of a scene, and the parameters of its wheel if it has one."""
    try:
        return scene.build(chosen), scene.wheel(chosen) if scene.wheel else None
    except ValueError as error:
        raise SceneError(f"{name}: {error}") from error


def _check_positive(label: str, value: float | None) -> None:
    if value is not None and not 0.0 < value < float("inf"):
        raise SceneError(f"the {label} must be positive, not {value:g} s")


def _chosen(name: str, defaults: Settings, changes: Mapping[str, str]) -> Settings:
    """The settings of a scene after changes, each of the type of its default."""
    chosen = dict(defaults)
    for key, value in changes.items():
        if key not in defaults:
            raise SceneError(f"{name} has no setting {key!r}; it has {', '.join(defaults)}")
        if isinstance(defaults[key], str):
            chosen[key] = value
            continue
        try:
            chosen[key] = float(value)
        except ValueError:
            raise SceneError(f"{name}: {key} must be a number, not {value!r}") from None
    return chosen
