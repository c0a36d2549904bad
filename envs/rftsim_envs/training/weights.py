"""The weights of a run's policy: how they are read, and taken over by another policy."""

from collections.abc import Mapping
from typing import Any

from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.save_util import load_from_zip_file

from rftsim_envs.recipe import TrainingError
from rftsim_envs.training.folder import Folder


def read_policy(folder: Folder) -> Mapping[str, Any]:
    """The weights of a run's policy by name; those of the checkpoint where it is not finished.

    Raises:
        TrainingError: There is none, or it cannot be read.
    """
    path = folder.policy if folder.policy.is_file() else folder.checkpoint
    if not path.is_file():
        raise TrainingError(f"{folder.path} has no policy yet: neither {folder.policy.name} nor {path.name} is there")
    try:
        _, parameters, _ = load_from_zip_file(str(path), device="cpu", load_data=False)
        return dict(parameters["policy"])
    except (OSError, ValueError, KeyError) as error:
        raise TrainingError(f"cannot take a policy from {path}: {error}") from error


def take_over(policy: ActorCriticPolicy, parameters: Mapping[str, Any], folder: Folder) -> None:
    """Give a policy the weights of another.

    Args:
        policy: The policy, which is changed in place.
        parameters: The weights by name.
        folder: The run that they are of, for the error.

    Raises:
        TrainingError: They are of another network.
    """
    try:
        policy.load_state_dict(dict(parameters))
    except RuntimeError as error:
        raise TrainingError(f"cannot take over the policy of {folder.path}: {error}") from error
