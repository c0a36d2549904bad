"""Recipes: settings of a policy's training, and the drives that it has to beat."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np

from rftsim.errors import RftsimError
from rftsim_envs.physics import Array
from rftsim_envs.settings import check_positive, convert_fields

Stepper = Literal["batch", "warp"]
"""What can step simulations: MuJoCo's own batch on threads, or mujoco_warp on a GPU."""
Drive = Callable[[float], Array]
"""Controller that sees nothing: an action, (naction,), from the time since the episode's start [s]."""


MOST_ENVS, MOST_COLLECTED, MOST_UPDATES, DEEPEST, WIDEST = 16_384, 100_000_000, 1_000_000, 16, 4096
"""Most simulations, control steps before an update, updates, layers and units of one: more would fill a memory."""
FARTHEST_LOG_STD = 10.0
"""Largest size of the logarithm of the actions' standard deviation at the start."""


def constant(*action: float) -> Drive:
    """A drive whose action is the same at all times."""
    return lambda time: np.array(action)


class TrainingError(RftsimError):
    """A training run that cannot be had or carried on."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Training:
    """Settings of PPO, of which each task has its own.

    Attributes:
        steps: Control steps in all, rounded up to whole steps of all simulations.
        n_envs: Simulations side by side.
        n_steps: Control steps of each between two updates, at most; all updates get nearly the same.
        batch_size: Control steps in a gradient's step.
        n_epochs: Passes over what was collected.
        gamma: Discount per control step.
        gae_lambda: Weight per control step in generalised advantage estimation.
        learning_rate: Rate at the start, from which it falls linearly to zero.
        clip_range: How far from 1 the ratio of new and old policy counts.
        ent_coef: Weight of the entropy.
        vf_coef: Weight of the value's error.
        max_grad_norm: Largest norm of a gradient; longer ones are shortened to it.
        layers: Units in each hidden layer (tanh) of the policy and of the value, which share none.
        log_std_init: Log of the actions' standard deviation at the start.
        log_std_last: Log of the largest standard deviation of the actions at the end. Where it is below `log_std_init`,
            the largest one falls to it linearly from there, so that what walks by its noise learns to walk without.
        normalise: Let the network see observations less their mean and over their standard deviation, which are learnt
            from all that was collected, and kept in the policy.
        start: Folder of a run whose policy is the first one, so that what it can do on easy ground need not be learnt
            anew on hard ground; of several runs the one with the same seed. Empty for a policy that can do nothing yet.
        physics: What steps the simulations: `batch`, MuJoCo's own on threads, or `warp`, mujoco_warp on a GPU.
    """

    steps: int = 1_000_000
    n_envs: int = 64
    n_steps: int = 128
    batch_size: int = 2048
    n_epochs: int = 5
    gamma: float = 0.99
    gae_lambda: float = 0.95
    learning_rate: float = 3e-4
    clip_range: float = 0.2
    ent_coef: float = 0.0
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    layers: tuple[int, ...] = (64, 64)
    log_std_init: float = -0.5
    log_std_last: float = FARTHEST_LOG_STD
    normalise: bool = False
    start: str = ""
    physics: Stepper = "batch"

    def __post_init__(self) -> None:
        convert_fields(self, TrainingError)
        positive = ("steps", "n_envs", "n_steps", "n_epochs", "learning_rate", "clip_range", "max_grad_norm")
        check_positive(self, positive, TrainingError)
        if self.batch_size < 2 or min(self.layers, default=0) < 1:
            raise TrainingError("batch_size must be at least 2, and layers one or more numbers of units")
        if self.n_envs > MOST_ENVS or self.n_envs * self.n_steps > MOST_COLLECTED or len(self.updates()) > MOST_UPDATES:
            raise TrainingError(
                f"there are at most {MOST_ENVS} simulations, {MOST_COLLECTED:g} steps before an update and "
                f"{MOST_UPDATES:g} updates, not n_envs = {self.n_envs}, n_steps = {self.n_steps}, steps = {self.steps}"
            )
        if max(self.layers) > WIDEST or len(self.layers) > DEEPEST:
            raise TrainingError(f"there are at most {DEEPEST} layers of at most {WIDEST} units, not {self.layers}")
        if self.learning_rate > 1.0:
            raise TrainingError(f"learning_rate is at most 1, not {self.learning_rate:g}")
        if max(abs(self.log_std_init), abs(self.log_std_last)) > FARTHEST_LOG_STD:
            raise TrainingError(
                f"log_std_init and log_std_last are within {FARTHEST_LOG_STD:g} of zero, not {self.log_std_init:g} and "
                f"{self.log_std_last:g}"
            )
        if not (0.0 < self.gamma <= 1.0 and 0.0 <= self.gae_lambda <= 1.0):
            raise TrainingError("gamma must be above 0 and at most 1, and gae_lambda between 0 and 1")

    def replace(self, changes: Mapping[str, Any]) -> "Training":
        """A copy with some settings changed; numbers may come as text.

        Raises:
            TrainingError: There is no such setting, or its value cannot be.
        """
        known = [field.name for field in dataclasses.fields(self)]
        for name in changes:
            if name not in known:
                raise TrainingError(f"PPO has no setting {name!r} here; it has {', '.join(known)}")
        return dataclasses.replace(self, **changes)

    def updates(self) -> list[int]:
        """Numbers of control steps of each simulation before each update; together they make `steps`, rounded up."""
        each = -(-self.steps // self.n_envs)
        count = min(-(-each // self.n_steps), MOST_UPDATES + 1)
        return [each * (k + 1) // count - each * k // count for k in range(count)]
