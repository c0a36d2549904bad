"""dm_control's own suite with its floors turned to sand."""

import contextlib
import functools
import importlib
import threading
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Final, NamedTuple

import mujoco
import numpy as np
from dm_control import suite
from dm_control.mujoco.wrapper import MjData, MjModel
from dm_control.rl import control

from rftsim.errors import SceneError
from rftsim.law.laws import Law
from rftsim.law.layout import TERRAIN_NUMBERS
from rftsim.model.height_field import field_terrain
from rftsim.model.readout import instances
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand
from rftsim_envs.dm.whole_steps import WholeSteps
from rftsim_envs.sandy_floor import Recipe, turn_to_sand

_LOADING: Final = threading.RLock()
FLAT: Final = 1e-9
"""Height of a field that is as good as level [m]."""


def on_sand(
    domain_name: str,
    task_name: str,
    sand: "Sand | str | Mapping[str, Any]" = "poppy-seeds",
    law: "Law | str" = "rft3d",
    *,
    task_kwargs: Mapping[str, Any] | None = None,
    environment_kwargs: Mapping[str, Any] | None = None,
    visualize_reward: bool = False,
    **options: Any,
) -> control.Environment:
    """One of the suite's environments with its floor turned to sand.

    Specifications and rewards are its own. While an episode is prepared, the floor is solid, because tasks place
    robots so that they touch nothing. Touch, force and torque sensors read the sand as they read that floor. A height
    field is sand with its relief, as the episode has made it; slopes beyond the sand's angle of repose are not told of.

    Args:
        domain_name: Name of a domain, as `quadruped`.
        task_name: Name of a task in it, as `run`.
        sand: The medium, see `rftsim.make_sand`.
        law: A law or its name.
        task_kwargs: As `suite.load` has it.
        environment_kwargs: As `suite.load` has it.
        visualize_reward: As `suite.load` has it.
        **options: Those of `rftsim.add_sand`; without `sensors=True` there are none, as some tasks observe them all.

    Raises:
        RftsimError: The scene cannot have sand.
        ValueError: There is no such domain or task.
    """
    if domain_name not in suite.TASKS_BY_DOMAIN:
        raise ValueError(f"no domain {domain_name!r}; domains are {', '.join(suite.TASKS_BY_DOMAIN)}")
    domain = importlib.import_module(f"dm_control.suite.{domain_name}")
    with _sandy(domain.Physics, Recipe(sand, law, {"sensors": False} | options)):
        env = suite.load(domain_name, task_name, task_kwargs, environment_kwargs, visualize_reward)
    if not isinstance(env.physics, OnSand):
        raise SceneError(f"{domain_name} {task_name} does not come from an XML text, so its floor cannot turn to sand")
    return env


class Floors(NamedTuple):
    """The geoms of a compiled model that turned to sand, and what they collided with before."""

    geoms: tuple[int, ...]
    """Their ids."""
    bits: tuple[tuple[int, int], ...]
    """The contype and conaffinity of each."""
    field: int | None = None
    """Id of the height field geom among them whose relief the sand has, where an episode makes it."""


class OnSand(WholeSteps):
    """Physics of one of the suite's domains, of whose class it is too, on sand."""

    domain: ClassVar[type[Any]]
    """The domain's own class of physics."""
    floors: ClassVar[Floors]
    """What is solid while an episode is prepared."""

    def step(self, nstep: int = 1) -> None:
        """Advance by whole steps on the sand alone."""
        with self._solid(False):
            super().step(nstep)

    @contextlib.contextmanager
    def reset_context(self) -> Iterator["OnSand"]:
        """Prepare an episode on a solid floor, as tasks look for poses in which nothing touches."""
        before = self._is_solid()
        with self._solid(True), super().reset_context():
            yield self
        if not before:
            self._take_relief()
            self.after_reset()

    def _take_relief(self) -> None:
        """Give the sand the heights that the height field now has."""
        if self.floors.field is None:
            return
        model, data = self.model.ptr, self.data.ptr
        terrain, (bed,) = field_terrain(model, data, self.floors.field), instances(model)
        assert bed.relief is not None, "sand in the place of a height field has relief"
        bed.relief[TERRAIN_NUMBERS:] = (
            terrain.height if isinstance(terrain, FreeSurface) else terrain.coefficients.ravel()
        )

    @contextlib.contextmanager
    def _solid(self, solid: bool) -> Iterator[None]:
        before = self._is_solid()
        self._make_solid(solid)
        try:
            yield
        finally:
            self._make_solid(before)

    def _is_solid(self) -> bool:
        return any(self.model.geom_contype[geom] or self.model.geom_conaffinity[geom] for geom in self.floors.geoms)

    def _make_solid(self, solid: bool) -> None:
        for geom, bits in zip(self.floors.geoms, self.floors.bits, strict=True):
            self.model.geom_contype[geom], self.model.geom_conaffinity[geom] = bits if solid else (0, 0)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles name the domain's class, as this one is made when it is needed."""
        return _empty, (self.domain, self.floors), self.__getstate__()


@contextlib.contextmanager
def _sandy(domain: Any, recipe: Recipe) -> Iterator[None]:
    """Let what this thread makes of a domain's class of physics stand on sand."""
    with _LOADING:
        thread, usual = threading.get_ident(), domain.from_xml_string

        def from_xml_string(xml_string: str, assets: Mapping[str, bytes] | None = None) -> Any:
            if threading.get_ident() != thread:
                return usual(xml_string, assets)
            return _physics(domain, xml_string, assets, recipe)

        domain.from_xml_string = from_xml_string
        try:
            yield
        finally:
            del domain.from_xml_string


def _physics(domain: Any, text: "str | bytes", assets: Mapping[str, bytes] | None, recipe: Recipe) -> OnSand:
    text = text.decode() if isinstance(text, bytes) else text
    spec = mujoco.MjSpec.from_string(text, include=dict(assets or {}), assets=dict(assets or {}))
    geoms = list(spec.geoms)
    before = [(geom.contype, geom.conaffinity) for geom in geoms]
    blank = next((geom for geom in geoms if _is_blank(spec, geom)), None)
    if blank is None:
        turn_to_sand(spec, recipe)
    else:
        _turn_blank(spec, blank, recipe)
    changed = [(g, bits) for g, bits in zip(geoms, before, strict=True) if (g.contype, g.conaffinity) != bits]
    for geom, bits in changed:
        geom.contype, geom.conaffinity = bits  # as MuJoCo's trees of what may touch hold what can touch when compiled
    model = spec.compile()
    field = None if blank is None else blank.id
    floors = Floors(tuple(geom.id for geom, _ in changed), tuple(bits for _, bits in changed), field)
    for geom in floors.geoms:
        model.geom_contype[geom] = model.geom_conaffinity[geom] = 0
    return _on_sand(domain, floors)(MjData(MjModel(model)))


def _is_blank(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Whether a geom is a height field that collides and whose heights each episode makes."""
    if geom.type != mujoco.mjtGeom.mjGEOM_HFIELD or not (geom.contype or geom.conaffinity):
        return False
    field = spec.hfield(geom.hfieldname)
    return not field.file and not np.diff(field.userdata).any()


def _turn_blank(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, recipe: Recipe) -> None:
    """Turn a height field without heights, and floors at its level, to sand that can take any; no triangle is spared.

    It stays in sight, of cameras and rangefinders, in place of a drawing of the sand. While the sand is written the
    field has heights that are next to nothing, as a level one would count as a plane.
    """
    options = {"terrain": geom.name, "reduction": 0.0, "draw": False, **recipe.options}
    field, colour = spec.hfield(geom.hfieldname), np.array(geom.rgba)
    size, heights = np.array(field.size), np.array(field.userdata)
    field.userdata = np.linspace(0.0, 1.0, field.nrow * field.ncol)
    field.size = [*size[:2], FLAT, size[3]]
    turn_to_sand(spec, recipe._replace(options=options))
    field.userdata, field.size, geom.rgba = heights, size, colour


@functools.cache
def _on_sand(domain: Any, floors: Floors) -> type[OnSand]:
    members = {"domain": domain, "floors": floors, "__doc__": domain.__doc__, "__module__": __name__}
    return type(f"{domain.__name__}OnSand", (OnSand, domain), members)


def _empty(domain: Any, floors: Floors) -> OnSand:
    """A physics without its data."""
    kind = _on_sand(domain, floors)
    return kind.__new__(kind)
