"""Several training runs: one per configuration and seed, each in a folder of its own, here or on Ray."""

import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rftsim_envs.recipe import TrainingError
from rftsim_envs.training.folder import Folder, Plan, make_plan, of_seed
from rftsim_envs.training.ppo import Trained, train
from rftsim_envs.training.spread import spread


def make_plans(
    env: str,
    settings: Mapping[str, Any],
    changes: Mapping[str, Any],
    *,
    seeds: Sequence[int],
    vary: Mapping[str, Sequence[str]],
    algo: str = "ppo",
) -> dict[str, Plan]:
    """The plans of several runs by folder, `KEY=VALUE,.../seed-N`.

    Args:
        env: `rftsim/NAME-v0`, or NAME.
        settings: Settings of the task, the same in all runs.
        changes: Settings of the training, the same in all runs.
        seeds: Seeds of the runs, each of which is trained with every combination.
        vary: Settings of the task with the values that they take, in all combinations.
        algo: One of `ALGORITHMS`.

    Raises:
        TrainingError: Two runs would share a folder.
    """
    found: dict[str, Plan] = {}
    for values in itertools.product(*vary.values()):
        varied = dict(zip(vary, values, strict=True))
        group = ",".join(f"{key}={value}" for key, value in varied.items())
        for seed in seeds:
            name = "/".join(filter(None, (re.sub(r"[^\w=,.+-]", "_", group), of_seed(seed))))
            if name in found:
                raise TrainingError(f"two runs would share the folder {name}")
            found[name] = make_plan(env, {**settings, **varied}, changes, seed=seed, algo=algo)
    return found


def train_all(
    plans: Mapping[str, Plan], out: Path, ray: str, report: Callable[[str, Trained], Any] = lambda name, trained: None
) -> dict[str, Trained]:
    """Train on Ray, a task for each run, with one thread; a run whose worker dies goes on from its checkpoint.

    Args:
        plans: Plans by folder in `out`.
        out: A folder where all workers can write.
        ray: `local`, or the address of a cluster.
        report: Called with each run that is finished.
    """
    finished = {name: train(plan, out / name) for name, plan in plans.items() if Folder(out / name).done}
    for name, trained in finished.items():
        report(name, trained)
    jobs = {name: (plan, (out / name).resolve()) for name, plan in plans.items() if name not in finished}
    found = finished | (spread(_train_alone, jobs, ray, report) if jobs else {})
    return {name: found[name] for name in plans}


def _train_alone(plan: Plan, path: Path) -> Trained:
    return train(plan, path, threads=1)
