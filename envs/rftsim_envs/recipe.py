"""How a policy for a task is trained, and what it has to beat."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any, get_type_hints

import numpy as np

from rftsim.errors import RftsimError
from rftsim_envs.physics import Array

Drive = Callable[[float], Array]
"""Actions from the time since the episode's start [s], (naction,): a controller that sees nothing."""


def constant(*action: float) -> Drive:
    """Always the same."""
    return lambda time: np.array(action)


class TrainingError(RftsimError):
    """A training that cannot be."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Training:
    """PPO's settings; each task has its own.

    Attributes:
        steps: Control steps in all, rounded up to whole steps of all simulations.
        n_envs: Simulations side by side.
        n_steps: Control steps of each between two updates, at most; all updates get nearly the same.
        batch_size: Control steps in a gradient's step.
        n_epochs: Passes over what was collected.
        gamma: Discount per control step.
        gae_lambda: Of the advantages.
        learning_rate: At the start; it falls linearly to zero.
        clip_range: Of the policy's ratio.
        ent_coef: Weight of the entropy.
        vf_coef: Weight of the value's error.
        max_grad_norm: Gradients are cut there.
        layers: Units in each hidden layer (tanh) of the policy and of the value, which share none.
        log_std_init: Log of the actions' standard deviation at the start.
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

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(type(self)).items():
            object.__setattr__(self, name, _checked(name, kind, getattr(self, name)))
        for name in ("steps", "n_envs", "n_steps", "n_epochs", "learning_rate", "clip_range", "max_grad_norm"):
            if not getattr(self, name) > 0:
                raise TrainingError(f"{name} must be positive, not {getattr(self, name)}")
        if self.batch_size < 2 or min(self.layers, default=0) < 1:
            raise TrainingError("batch_size must be at least 2, and layers one or more numbers of units")
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
        """Control steps of each simulation before each update; together they make `steps`, rounded up."""
        each = math.ceil(self.steps / self.n_envs)
        count = math.ceil(each / self.n_steps)
        return [each * (k + 1) // count - each * k // count for k in range(count)]


def _checked(name: str, kind: Any, value: Any) -> Any:
    try:
        if kind is float:
            number = float(value)
            if isinstance(value, bool) or not math.isfinite(number):
                raise ValueError
            return number
        if kind is int:
            return _whole(value)
        return tuple(_whole(part) for part in (value.split(",") if isinstance(value, str) else value))
    except (TypeError, ValueError):
        wanted = {float: "a finite number", int: "a whole number"}.get(kind, "whole numbers: 64,64")
        raise TrainingError(f"{name} must be {wanted}, not {value!r}") from None


def _whole(value: Any) -> int:
    number = float(value)  # 2e6 is whole, too
    if isinstance(value, bool) or number != int(number):
        raise ValueError
    return int(number)
