"""Actors, which choose actions: a trained policy, or what it is compared with."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.utils import ConstantSchedule

from rftsim_envs.env import spaces
from rftsim_envs.episodes import Episodes, Observation
from rftsim_envs.recipe import Drive
from rftsim_envs.training.folder import Folder
from rftsim_envs.training.network import network
from rftsim_envs.training.weights import read_policy, take_over

Actor = Callable[[Observation, float], NDArray[Any]]
"""Actions (n, naction) as a function of what is seen, (n, nobservation), and the time since the start [s]."""
Maker = Callable[[Episodes], Actor]
"""An actor as a function of the episodes that it acts in."""


def trained(folder: Folder) -> Maker:
    """A maker of actors by the policy of a run, without its noise; that of the checkpoint where it is not finished."""
    training, parameters = folder.plan().training, read_policy(folder)

    def make(episodes: Episodes) -> Actor:
        policy = ActorCriticPolicy(*spaces(episodes), ConstantSchedule(0.0), **network(training))
        take_over(policy, parameters, folder)
        policy.set_training_mode(False)

        def act(seen: Observation, time: float) -> NDArray[Any]:
            with torch.no_grad():
                return policy.predict(seen, deterministic=True)[0]

        return act

    return make


def at_random(seed: int) -> Maker:
    """A maker of actors whose actions are drawn anew in each step, evenly between -1 and 1."""

    def make(episodes: Episodes) -> Actor:
        rng, naction = np.random.default_rng(seed), episodes.task.naction
        return lambda seen, time: rng.uniform(-1.0, 1.0, (len(seen), naction))

    return make


def zero(episodes: Episodes) -> Actor:
    """An actor whose actions are all zero."""
    return lambda seen, time: np.zeros((len(seen), episodes.task.naction))


def open_loop(drive: Drive) -> Maker:
    """A maker of actors by a drive that sees nothing, the same in all simulations."""
    return lambda episodes: lambda seen, time: np.tile(drive(time), (len(seen), 1))
