"""Gymnasium's own MuJoCo environments with their floor turned to sand."""

import importlib
from collections.abc import Mapping
from typing import Any, Final

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec, WrapperSpec, load_env_creator

from rftsim.law.laws import Law
from rftsim.sand.medium import Sand

ID: Final = "rftsim/OnSand-v0"
"""Name under which `gymnasium.make` and `make_vec` find them all; the keyword `env_id` says which one."""
ENTRY: Final = "rftsim_envs.sandy_mujoco_env:OnSand"
"""Where their class is."""


def on_sand(
    env_id: str,
    sand: "Sand | str | Mapping[str, Any]" = "poppy-seeds",
    law: "Law | str" = "rft3d",
    *,
    max_episode_steps: int | None = None,
    disable_env_checker: bool | None = None,
    **options: Any,
) -> "gym.Env[Any, Any]":
    """One of gymnasium's MuJoCo environments with its floor turned to sand.

    Spaces, rewards, terminations and wrappers are its own, and so are observations and costs of contact forces: they
    count the sand's. Robots sink, while what counts as healthy stays as it is; so choose a sand that is firm enough.

    Args:
        env_id: Its id, as `Ant-v5`; of another's environment `module:Name-v0`, if its class is a `MujocoEnv`.
        sand: The medium, see `rftsim.make_sand`.
        law: A law or its name.
        max_episode_steps: As `gymnasium.make` has it.
        disable_env_checker: As `gymnasium.make` has it.
        **options: Those of `rftsim.add_sand`; and the environment's own keywords, as `render_mode`.

    Raises:
        SceneError: It is no MuJoCo environment, or cannot have sand.
        gymnasium.error.UnregisteredEnv: There is no such id.
    """
    own = registered(env_id)
    spec = EnvSpec(
        ID,
        entry_point=ENTRY,
        reward_threshold=own.reward_threshold,
        nondeterministic=own.nondeterministic,
        max_episode_steps=own.max_episode_steps,
        order_enforce=own.order_enforce,
        disable_env_checker=own.disable_env_checker,
        additional_wrappers=own.additional_wrappers,
        kwargs={"env_id": env_id, "sand": sand, "law": law, **options},
    )
    return gym.make(spec, max_episode_steps, disable_env_checker)


def register() -> None:
    """Make the environments known to Gymnasium under one id."""
    wrappers = WrapperSpec("own_wrappers", f"{__name__}:own_wrappers", {})
    gym.register(ID, entry_point=ENTRY, additional_wrappers=(wrappers,))


def own_wrappers(env: "gym.Env[Any, Any]") -> "gym.Env[Any, Any]":
    """Put around an environment on sand what is around it without sand: its limit of time, if it has none yet."""
    own = registered(env.get_wrapper_attr("env_id"))
    if own.max_episode_steps is not None and env.spec is not None and env.spec.max_episode_steps is None:
        env = gym.wrappers.TimeLimit(env, own.max_episode_steps)
    for wrapper in own.additional_wrappers:
        make: Any = load_env_creator(wrapper.entry_point)
        env = make(env=env, **(wrapper.kwargs or {}))
    return env


def registered(env_id: str) -> EnvSpec:
    """The specification that Gymnasium has under an id, whose module may stand before a colon.

    Raises:
        gymnasium.error.UnregisteredEnv: There is no such id.
    """
    module, _, name = env_id.rpartition(":")
    if module:
        importlib.import_module(module)
    return gym.spec(name)
