"""Training by PPO on `SandVecEnv`, which can be stopped and goes on."""

import contextlib
import io
import json
import math
import time
import zipfile
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat
from stable_baselines3.common.utils import ConstantSchedule

from rftsim_envs.recipe import Training, TrainingError
from rftsim_envs.sb3 import SandVecEnv
from rftsim_envs.training.folder import Folder, Plan, Progress, of_seed, write_whole
from rftsim_envs.training.network import Normalising, network
from rftsim_envs.training.weights import read_policy, take_over

EVERY_SECONDS: Final = 5.0
"""Time after which an update is followed by a checkpoint [s]."""
EVERY_STEPS: Final = 50_000
"""Number of control steps after which an update is followed by a checkpoint."""
EPISODES: Final = 100
"""Number of last episodes over which means are reported."""
THREADS: Final = 1
"""Number of torch's threads, for the networks are small."""
NEVER: Final = 1 << 62
"""Number of updates between two of SB3's own logs."""
MEMBER: Final = "rftsim.json"
"""Name in a checkpoint's archive of what SB3 does not keep."""


class Trained(NamedTuple):
    """State of a run when a call of `train` ended."""

    steps: int
    """Number of control steps in all, of this call and those before it."""
    began: int
    """Number of control steps before this call."""
    done: bool
    """Whether the run is finished; otherwise it was stopped."""


Report = Callable[[Mapping[str, Any]], None]
"""Function that is called with each row of progress.csv."""


def train(
    plan: Plan,
    path: "str | Path",
    *,
    threads: int = 0,
    tensorboard: bool = False,
    report: Report = lambda row: None,
    stop: Callable[[], bool] = lambda: False,
) -> Trained:
    """Train in a folder, from its last checkpoint if it has one.

    A run that was killed loses what came after its checkpoint; the simulations begin new episodes.

    Args:
        plan: What is asked.
        path: The folder.
        threads: Number of the simulations' threads; 0 for as many as there are processors. The result is the same.
        tensorboard: Write for TensorBoard, too.
        report: Called after each update.
        stop: Asked at each control step; if true, the run is left with a checkpoint of its last update.

    Raises:
        TrainingError: The folder belongs to another plan or to another process, or it cannot be written.
    """
    folder, training = Folder(path), plan.training
    updates, total = training.updates(), sum(training.updates()) * training.n_envs
    if folder.done:
        folder.check(plan)
        return Trained(total, total, True)
    env = SandVecEnv(plan.task, training.n_envs, threads, training.physics, **plan.settings)
    model = make_model(training, env, plan.seed)  # what cannot be is refused before anything is written
    if training.start and not folder.checkpoint.is_file():
        before = _run_before(training.start, plan.seed)
        take_over(model.policy, read_policy(before), before)
    with folder.opened(plan):
        run = _Run(plan, env, model, folder, tensorboard)
        began = run.resume()
        done = run.carry_on(updates, report, stop)
        run.save()
        if done:
            run.write(folder.policy, folder.checkpoint.read_bytes())
            folder.write_config(plan, done=True)
        return Trained(run.steps, began, done)


def _run_before(start: str, seed: int) -> Folder:
    """The run whose policy is the first one: of several with a seed each, the one that has this seed."""
    alike = Path(start) / of_seed(seed)
    return Folder(alike if alike.is_dir() else start)


def make_model(training: Training, env: SandVecEnv, seed: int) -> PPO:
    """SB3's PPO with these settings, not yet trained."""
    return PPO(
        "MlpPolicy",
        env,
        learning_rate=training.learning_rate,
        n_steps=training.n_steps,
        batch_size=min(training.batch_size, training.n_steps * training.n_envs),
        n_epochs=training.n_epochs,
        gamma=training.gamma,
        gae_lambda=training.gae_lambda,
        clip_range=training.clip_range,
        ent_coef=training.ent_coef,
        vf_coef=training.vf_coef,
        max_grad_norm=training.max_grad_norm,
        policy_kwargs=network(training),
        seed=seed,
        device="cpu",
    )


class _Run:
    """A run between two checkpoints."""

    def __init__(self, plan: Plan, env: SandVecEnv, model: PPO, folder: Folder, tensorboard: bool) -> None:
        self.env, self.folder, self.updates, self.steps = env, folder, 0, 0
        self.model = model
        formats: list[KVWriter] = [TensorBoardOutputFormat(str(folder.tensorboard))] if tensorboard else []
        self.model.set_logger(Logger(None, formats))
        self._training, self._callback = plan.training, _Callback()
        self._spent, self._saved = 0.0, (time.monotonic(), 0)

    @property
    def rows(self) -> list[dict[str, str]]:
        return self._progress.rows

    def resume(self) -> int:
        """Go to the last checkpoint; at the first time write one, which shows whether one can be written."""
        if self.folder.checkpoint.is_file():
            kept = _read(self.folder.checkpoint)
            self.model.set_parameters(str(self.folder.checkpoint), device="cpu")
            self.updates, self.steps, self._spent = kept["updates"], kept["steps"], kept["seconds"]
            self._callback.episodes.extend(kept["episodes"])
            _set_random_states(kept["random"], self.env)
        else:
            self.env.seed(self.model.seed)
        self.model.num_timesteps = self.steps
        self._progress = Progress(self.folder.progress, self.updates)
        if not self.updates:
            self.env.reset()
            self.save()
        self._saved = time.monotonic(), self.steps
        return self.steps

    def carry_on(self, updates: list[int], report: Report, stop: Callable[[], bool]) -> bool:
        """Do the updates that are left; False where they were stopped."""
        with torch_threads(THREADS):
            for k in range(self.updates, len(updates)):
                if not self.update(updates[k], 1.0 - k / len(updates), stop):
                    return False
                report(self.rows[-1])
                self.save_sometimes()
        return True

    def update(self, n: int, left: float, stop: Callable[[], bool]) -> bool:
        """Collect n control steps of each simulation and learn from them; False where it was stopped."""
        began, self._callback.stop = time.monotonic(), stop
        self.model.n_steps = self.model.rollout_buffer.buffer_size = n
        self.model.lr_schedule = ConstantSchedule(left * self._training.learning_rate)
        self._quieten(left)
        self.model.learn(n * self.env.num_envs, self._callback, NEVER, reset_num_timesteps=False)
        if self._callback.stopped:
            return False
        self._normalise()
        self.updates, self.steps = self.updates + 1, self.steps + n * self.env.num_envs
        took = time.monotonic() - began
        self._spent += took
        means = self._callback.means()
        row = {
            "update": self.updates,
            "steps": self.steps,
            "seconds": round(self._spent, 3),
            "steps_per_second": round(n * self.env.num_envs / took, 1),
            "reward": f"{self._callback.reward:.6g}",
            "return": means.pop("r", ""),
            "length": means.pop("l", ""),
        }
        try:
            self._progress.add(row | {name: means.get(name, "") for name in self._callback.names})
        except TrainingError as error:
            raise TrainingError(f"{error}. {self._what_is_kept()}") from error
        for name, value in means.items():
            self.model.logger.record(f"episode/{name}", float(value))
        self.model.dump_logs()
        return True

    def _quieten(self, left: float) -> None:
        """Let the actions' deviation be at most what it may be with this share of the training left."""
        first, last = self._training.log_std_init, self._training.log_std_last
        if last < first:
            self.model.policy.log_std.data.clamp_(max=left * first + (1.0 - left) * last)

    def _normalise(self) -> None:
        """Let the network learn what is usual to see, once an update has compared with the policy that collected."""
        eye = self.model.policy.features_extractor
        if isinstance(eye, Normalising):
            eye.learn(self.model.rollout_buffer.observations.reshape(-1, eye.features_dim))

    def save_sometimes(self) -> None:
        when, where = self._saved
        if time.monotonic() - when >= EVERY_SECONDS or self.steps - where >= EVERY_STEPS:
            self.save()

    def save(self) -> None:
        """Write the checkpoint."""
        buffer = io.BytesIO()
        self.model.save(buffer, exclude=["_last_obs", "_last_episode_starts", "ep_info_buffer", "_custom_logger"])
        kept = {
            "updates": self.updates,
            "steps": self.steps,
            "seconds": self._spent,
            "episodes": list(self._callback.episodes),
            "random": _random_states(self.env),
        }
        with zipfile.ZipFile(buffer, "a") as archive:
            archive.writestr(MEMBER, json.dumps(kept))
        self.write(self.folder.checkpoint, buffer.getvalue())
        self._saved = time.monotonic(), self.steps

    def write(self, path: Path, content: bytes) -> None:
        """Write a file; an error says what is kept."""
        try:
            write_whole(path, content)
        except TrainingError as error:
            raise TrainingError(f"{error}. {self._what_is_kept()}") from error

    def _what_is_kept(self) -> str:
        if not self.folder.checkpoint.is_file():
            return "Nothing was trained."
        steps = _read(self.folder.checkpoint)["steps"]
        return f"The checkpoint at {steps} steps is whole: the same command goes on there."


class _Callback(BaseCallback):
    """Sees whether to stop, and what the episodes came to."""

    def __init__(self) -> None:
        super().__init__()
        self.episodes: deque[dict[str, float]] = deque(maxlen=EPISODES)
        self.stop: Callable[[], bool] = lambda: False
        self.stopped, self.reward, self.names = False, math.nan, list[str]()

    def _on_rollout_start(self) -> None:
        self._rewards: list[float] = []

    def _on_step(self) -> bool:
        self._rewards.append(float(self.locals["rewards"].mean()))
        self.episodes.extend(info["episode"] for info in self.locals["infos"] if info)
        self.stopped = self.stop()
        return not self.stopped

    def _on_rollout_end(self) -> None:
        self.reward = float(np.mean(self._rewards))
        self.names = self.training_env.get_attr("measured")[0]

    def means(self) -> dict[str, str]:
        """Mean of each number over the last episodes, as text."""
        if not self.episodes:
            return {}
        return {name: f"{np.mean([one[name] for one in self.episodes]):.6g}" for name in self.episodes[-1]}


def _random_states(env: SandVecEnv) -> dict[str, Any]:
    kind, keys, *rest = np.random.get_state(legacy=True)  # noqa: NPY002  (SB3 draws from it)
    return {
        "torch": torch.get_rng_state().numpy().tobytes().hex(),
        "numpy": [kind, np.asarray(keys).tolist(), *rest],
        "env": [rng.bit_generator.state for rng in env.rngs],
    }


def _set_random_states(kept: Mapping[str, Any], env: SandVecEnv) -> None:
    torch.set_rng_state(torch.frombuffer(bytearray.fromhex(kept["torch"]), dtype=torch.uint8))
    np.random.set_state(tuple(kept["numpy"]))  # noqa: NPY002
    for rng, state in zip(env.rngs, kept["env"], strict=True):
        rng.bit_generator.state = state


def _read(checkpoint: Path) -> dict[str, Any]:
    try:
        with zipfile.ZipFile(checkpoint) as archive:
            kept: dict[str, Any] = json.loads(archive.read(MEMBER))
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise TrainingError(f"{checkpoint} is not a checkpoint of rftsim: {error}") from error
    return kept


@contextlib.contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Let torch use this number of threads until the block ends."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
