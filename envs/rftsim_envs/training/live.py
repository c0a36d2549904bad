"""Episodes live in MuJoCo's viewer, one after the other, under the keys and the mouse."""

import mujoco

from rftsim.view.cameras import framing
from rftsim.view.live import Live
from rftsim_envs.env import SandEnv
from rftsim_envs.episodes import Observation
from rftsim_envs.tally import Tally
from rftsim_envs.training.actors import Maker


class LiveEpisodes(Live):
    """Episodes of an environment, each of which begins when the one before it has ended.

    The key that starts again begins the next episode, and sand that was made stronger stays so in all that follow.

    Args:
        env: The environment, which is driven from here on.
        maker: Maker of the actor that chooses the actions.
        seed: Seed of the first episode; episode k is seeded with seed + k.

    Attributes:
        ended: What each episode that has ended came to, see `Tally.take`.
    """

    def __init__(self, env: SandEnv, maker: Maker, seed: int) -> None:
        self._env, self._seed = env, seed
        self._actor = maker(env.episodes)
        self.ended: list[dict[str, float]] = []
        self._seen, self._steps, self._tally = self._reset(), 0, Tally(1)
        super().__init__(env.model, lambda: env.data)
        self.tick = env.config.period

    def step(self) -> None:
        """Take a control step, and begin the next episode where that one has ended."""
        time = self._steps * self.tick
        out = self._env.episodes.step(self._actor(self._seen, time))
        self._tally.add(out)
        self._seen, self._steps = out.observation, self._steps + 1
        if out.terminated[0] or out.truncated[0]:
            self.restart()

    def restart(self) -> None:
        """Begin the next episode, in the same data, on sand as strong as the keys have made it."""
        self.ended.append(self._tally.take(0))
        self._seen, self._steps, self._tally = self._reset(), 0, Tally(1)
        self.strengthen(self.strength)

    def aim(self) -> mujoco.MjvCamera:
        """A camera that follows the robot."""
        camera = framing(self.model, self.data)
        camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        camera.trackbodyid = int(self.model.body_rootid[self.model.jnt_bodyid[0]])
        return camera

    def state(self) -> list[tuple[str, str]]:
        """Names and values of the episode and of its return so far, and of what all simulations tell."""
        number = ("episode", f"{len(self.ended)}, of seed {self._seed + len(self.ended)}")
        return [number, ("return", f"{self._tally.so_far(0):.3g}"), *super().state()]

    def _reset(self) -> Observation:
        self._env.reset(seed=self._seed + len(self.ended))
        return self._env.episodes.observation()
