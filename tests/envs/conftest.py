"""A training run that tests of training, scores and watching share."""

import pytest
from short_runs import SHORT, TASK, TINY


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """The folder of a finished run."""
    pytest.importorskip("stable_baselines3")
    from rftsim_envs.training import ppo
    from rftsim_envs.training.folder import make_plan

    path = tmp_path_factory.mktemp("run")
    assert ppo.train(make_plan(TASK, SHORT, TINY), path) == (500, 0, True)
    return path
