"""The studies of cost: what they measure is right, whatever the machine's speed."""

import math

import numpy as np
import pytest

from rftsim.bench import environment, pareto
from rftsim.bench.environment_picture import plot_environment
from rftsim.bench.pareto import Compared, Tried
from rftsim.bench.pareto_picture import plot_pareto


def tried(cost, error, h=1e-3):
    return Tried("runner", "drft2d", "shipped", 400, 0.0, "implicit", h, error, cost * h)


def test_the_front_is_what_nothing_cheaper_comes_near():
    """Of four, one is dearer and no better, and one is hardly better."""
    best, good, dear, close = tried(4.0, 0.1), tried(1.0, 0.4), tried(2.0, 0.5), tried(1.1, 0.39)
    assert pareto.front([dear, best, close, good]) == [good, best]


@pytest.fixture(scope="module")
def runner():
    """The runner with its own triangles, at two time steps."""
    return Compared(*pareto._compare("runner", "drft2d", ("shipped",), (1e-3, 5e-3)))


def test_a_shorter_step_is_nearer_to_the_reference(runner, tmp_path):
    """The path converges with the step: a fifth of it errs by less than half."""
    error = {(one.force, one.h): one.error for one in runner.tried}
    assert 0.0 < error["implicit", 1e-3] < 0.5 * error["implicit", 5e-3] < 0.005
    assert all(math.isfinite(value) for value in error.values())
    assert pareto.laws_apart([Compared(runner.tried, np.array(runner.path))]) == {("runner", "drft2d"): 0.0}
    plot_pareto([Compared(runner.tried, np.array(runner.path))], tmp_path / "pareto.png")
    assert (tmp_path / "pareto.png").stat().st_size > 10_000


def test_the_step_with_sand_over_the_one_without(tmp_path):
    """Each evaluation of the force costs time; the batch's simulations have sand of their own and lose no step."""
    pytest.importorskip("mujoco.batch")
    none, explicit, implicit = environment._case("runner", "drft2d", 3, lambda _: None)
    assert none.ratio == 1.0
    assert 1.0 < explicit.ratio < implicit.ratio
    assert explicit.evaluations == 1.0
    assert implicit.evaluations >= 1.0
    for one in (explicit, implicit):
        assert all(0.0 < share < 1.0 for _, share in one.batch.values())
    plot_environment([none, explicit, implicit], tmp_path / "environment.png")
    assert (tmp_path / "environment.png").stat().st_size > 10_000
