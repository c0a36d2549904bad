"""The network of a policy, and how it sees: observations as they are, or less their mean and over their spread."""

from typing import Any, Final

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

from rftsim_envs.recipe import Training

FARTHEST: Final = 10.0
"""Largest size of a normalised observation, in standard deviations; what is larger is cut to it."""
TINY: Final = 1e-4
"""Smallest standard deviation that counts as one."""


def network(training: Training) -> dict[str, Any]:
    """Arguments of SB3's policy that make the network of a training."""
    made: dict[str, Any] = {"net_arch": list(training.layers), "log_std_init": training.log_std_init}
    return made | ({"features_extractor_class": Normalising} if training.normalise else {})


class Normalising(BaseFeaturesExtractor):
    """Observations less their mean, over their standard deviation, of all that were collected before the last update.

    Mean and variance are part of the policy: they are in its file, and in checkpoints, and stay as they are where the
    policy is only played.

    Args:
        space: The space of observations, (nobservation,).
    """

    mean: torch.Tensor
    variance: torch.Tensor
    count: torch.Tensor

    def __init__(self, space: gym.spaces.Box) -> None:
        size = int(np.prod(space.shape))
        super().__init__(space, size)
        self.register_buffer("mean", torch.zeros(size, dtype=torch.float64))
        self.register_buffer("variance", torch.ones(size, dtype=torch.float64))
        self.register_buffer("count", torch.zeros((), dtype=torch.float64))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Normalise observations, (n, nobservation), and cut what is far out."""
        spread = self.variance.clamp(min=TINY**2).sqrt()
        return ((observations - self.mean) / spread).clamp(-FARTHEST, FARTHEST).float()

    def learn(self, seen: NDArray[np.float32]) -> None:
        """Take observations, (n, nobservation), into the mean and the variance."""
        new = torch.from_numpy(seen.astype(np.float64))
        n, total = len(new), self.count + len(new)
        away = new.mean(dim=0) - self.mean
        squares = self.variance * self.count + new.var(dim=0, correction=0) * n + away**2 * (self.count * n / total)
        self.mean += away * (n / total)
        self.variance.copy_(squares / total)
        self.count.copy_(total)
