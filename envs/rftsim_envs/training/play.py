"""Episodes one after the other, to look at, to film and to picture."""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np
from matplotlib import image
from numpy.typing import NDArray

from rftsim.view import film
from rftsim.view.cameras import SIZE, framing
from rftsim.view.drawing import ALL
from rftsim.view.render import Pictures
from rftsim_envs.env import FOLLOW, SandEnv, has_camera
from rftsim_envs.tally import Tally
from rftsim_envs.training.actors import Maker

MOMENTS: Final = 4
"""Number of pictures in a strip."""
STRIP: Final = (SIZE[0] // 2, SIZE[1])
"""Width and height of each of them [pixels]."""


def play(
    env: SandEnv,
    maker: Maker,
    episodes: int,
    seed: int,
    *,
    seconds: float | None,
    watch: Callable[[Mapping[str, Any]], None],
) -> Iterator[dict[str, float]]:
    """Play episodes, and yield what each came to.

    Args:
        env: The environment.
        maker: Maker of the actor that chooses the actions.
        episodes: Number of episodes.
        seed: Seed of the first episode; episode k is seeded with seed + k.
        seconds: Duration after which an episode is cut [s]; None for its own.
        watch: Called with the info of each control step.
    """
    steps = env.config.steps if seconds is None else max(round(seconds / env.config.period), 1)
    for k in range(episodes):
        env.reset(seed=seed + k)
        seen, actor, tally = env.episodes.observation(), maker(env.episodes), Tally(1)
        for step in range(steps):
            out = env.episodes.step(actor(seen, step * env.config.period))
            tally.add(out)
            watch(out.info)
            seen = out.observation
            if out.terminated[0] or out.truncated[0]:
                break
        yield tally.take(0)


@contextlib.contextmanager
def taking_strip(env: SandEnv, path: Path) -> Iterator[Callable[[Mapping[str, Any]], None]]:
    """Take a picture of `MOMENTS` moments, evenly spaced, on sand: call what is given after each control step.

    Arrows are the sand's forces and tractions, and what is buried shows.
    """
    states: list[NDArray[np.float64]] = []
    kept, model = mujoco.mjtState.mjSTATE_INTEGRATION, env.model

    def watch(info: Mapping[str, Any]) -> None:
        state = np.empty(mujoco.mj_stateSize(model, kept))
        mujoco.mj_getState(model, env.data, state, kept)
        states.append(state)

    yield watch
    data, pictures = mujoco.MjData(model), []
    with Pictures(model, *STRIP, ALL) as taker:
        for k in np.linspace(0, len(states) - 1, MOMENTS).round().astype(int):
            mujoco.mj_setState(model, data, states[k], kept)
            mujoco.mj_forward(model, data)
            pictures.append(
                taker.take(data, FOLLOW if has_camera(model) else framing(model, data, STRIP[0] / STRIP[1]))
            )
    image.imsave(path, np.hstack(pictures))


@contextlib.contextmanager
def filming(env: SandEnv, path: Path) -> Iterator[Callable[[Mapping[str, Any]], None]]:
    """Film an environment, which must render: call what is given after each control step.

    Raises:
        RftsimError: It cannot be written.
    """
    clock = 0.0
    with film.filming(path, *SIZE) as show:

        def watch(info: Mapping[str, Any]) -> None:
            nonlocal clock
            clock += env.config.period
            show(env.render, clock)

        yield watch
