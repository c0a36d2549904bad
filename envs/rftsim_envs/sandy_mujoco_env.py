"""The class of gymnasium's MuJoCo environments whose floor is sand."""

import functools
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from gymnasium.envs.mujoco import MujocoEnv
from gymnasium.envs.registration import EnvSpec, load_env_creator
from numpy.typing import NDArray

from rftsim.errors import SceneError
from rftsim.law.laws import Law
from rftsim.model.reactions import rne_post_constraint
from rftsim.sand.medium import Sand
from rftsim_envs.gymnasium_on_sand import registered
from rftsim_envs.sandy_floor import OPTIONS, Recipe, turn_to_sand


class OnSand(MujocoEnv):
    """An environment of gymnasium's, of whose class it is too, with its floor turned to sand; see `on_sand`."""

    metadata = {"render_modes": ["human", "rgb_array", "depth_array", "rgbd_tuple"]}  # noqa: RUF012, as Gymnasium has it

    def __new__(cls, env_id: str, *_args: Any, **_options: Any) -> "OnSand":
        """Make an instance of a class that inherits from this one and from that of the environment."""
        instance: OnSand = object.__new__(_on_sand(_class(env_id)))
        return instance

    def __init__(
        self,
        env_id: str,
        sand: "Sand | str | Mapping[str, Any]" = "poppy-seeds",
        law: "Law | str" = "rft3d",
        **options: Any,
    ) -> None:
        self.env_id, self._options = env_id, options
        self.recipe = Recipe(sand, law, {name: options[name] for name in OPTIONS & options.keys()})
        own = {name: options[name] for name in options.keys() - OPTIONS}
        super().__init__(**registered(env_id).kwargs | own)

    def _initialize_simulation(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        spec = mujoco.MjSpec.from_file(self.fullpath)
        turn_to_sand(spec, self.recipe)
        model = spec.compile()
        buffer = model.vis.global_
        buffer.offwidth, buffer.offheight = max(buffer.offwidth, self.width), max(buffer.offheight, self.height)
        return model, mujoco.MjData(model)

    def _step_mujoco_simulation(self, ctrl: NDArray[np.float32], n_frames: int) -> None:
        super()._step_mujoco_simulation(ctrl, n_frames)  # type: ignore[no-untyped-call]
        rne_post_constraint(self.model, self.data)  # as Gymnasium does, and with the sand's force

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles and copies are new environments with the same settings, as Gymnasium has it."""
        return _again, (self.env_id, self.recipe, self._options, self.spec)


def _class(env_id: str) -> Any:
    creator: Any = registered(env_id).entry_point
    if isinstance(creator, str):
        creator = load_env_creator(creator)
    if not (isinstance(creator, type) and issubclass(creator, MujocoEnv)):
        raise SceneError(
            f"{env_id} is no MuJoCo environment of gymnasium: {getattr(creator, '__name__', creator)} is no "
            "gymnasium.envs.mujoco.MujocoEnv, so it has no floor that could turn to sand"
        )
    if creator._initialize_simulation is not MujocoEnv._initialize_simulation:
        raise SceneError(f"{env_id} makes its model in its own way, not from an XML file alone: add_sand to that model")
    return creator


@functools.cache
def _on_sand(base: Any) -> type[OnSand]:
    return type(f"{base.__name__}OnSand", (OnSand, base), {"metadata": base.metadata, "__doc__": base.__doc__})


def _again(env_id: str, recipe: Recipe, options: dict[str, Any], spec: EnvSpec | None) -> OnSand:
    env = OnSand(env_id, recipe.sand, recipe.law, **options)
    env.spec = spec
    return env
