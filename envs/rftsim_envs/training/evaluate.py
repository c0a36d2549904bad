"""Scores: how good a policy is on which ground."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import gymnasium as gym
import numpy as np

from rftsim.sand.presets import make_sand
from rftsim_envs import ground, tasks
from rftsim_envs.episodes import Episodes
from rftsim_envs.physics import Many
from rftsim_envs.recipe import TrainingError
from rftsim_envs.tally import Tally
from rftsim_envs.training import actors
from rftsim_envs.training.folder import Folder, Plan

LEVEL: Final[Mapping[str, Any]] = {
    "ground": "sand",
    "strength": (1.0, 1.0),
    "friction": (1.0, 1.0),
    "slope_deg": 0.0,
    "terrain": "level",
    "ruts": False,
}
"""Settings of the task's own sand, level and alike in all episodes."""
PRESETS: Final = ("poppy-seeds", "close-poppy-seeds", "glass-beads", "medium-sand")
POLICY: Final = "policy"
RANDOM: Final = "random"
OPEN_LOOP: Final = "open loop"
SEARCHED: Final = 4
"""Number of episodes by which the best of the drives is found."""
AS_TRAINED: Final = "as trained"
GROUNDS: Final[Mapping[str, Mapping[str, Any]]] = {
    AS_TRAINED: {},
    "sand": LEVEL,
    "half as strong": {**LEVEL, "strength": (0.5, 0.5)},
    "twice as strong": {**LEVEL, "strength": (2.0, 2.0)},
    "slopes to 5 deg": {**LEVEL, "slope_deg": 5.0},
    "slopes to 10 deg": {**LEVEL, "slope_deg": 10.0},
    "dunes": {**LEVEL, "terrain": "dunes"},
    **{preset: {**LEVEL, "sand": preset} for preset in PRESETS},
    "rigid": {**LEVEL, "ground": "rigid"},
}
"""Settings of each ground by its name."""


class Score(NamedTuple):
    """Score of an actor on a ground."""

    ground: str
    """Name of the ground, one of `GROUNDS`."""
    actor: str
    """Kind of the actor: `POLICY`, `RANDOM` or `OPEN_LOOP`."""
    episodes: list[dict[str, float]]
    """Numbers of each episode as `Tally.take` gives them, and `early`: whether it ended too soon, without success."""
    which: str = ""
    """Name of the best drive that sees nothing, where that is the actor."""

    def mean(self, name: str) -> float:
        """Mean of a number over the episodes, nan where it is not measured."""
        return float(np.mean([episode.get(name, np.nan) for episode in self.episodes]))

    def std(self, name: str) -> float:
        """Standard deviation of a number over the episodes, nan where it is not measured."""
        return float(np.std([episode.get(name, np.nan) for episode in self.episodes]))


def settings_on(plan: Plan, name: str) -> dict[str, Any] | None:
    """The plan's settings on a ground; None where its law cannot be had there.

    Raises:
        TrainingError: There is no such ground.
    """
    if name not in GROUNDS:
        raise TrainingError(f"no ground {name!r}; grounds are {', '.join(GROUNDS)}")
    changed = dict(GROUNDS[name])
    if "sand" in changed:
        own = make_sand(plan.settings["sand"])
        if plan.settings["law"].startswith("drft") and make_sand(changed["sand"]).rho_c is None:
            return None
        changed["sand"] = f"preset={changed['sand']},lambda_={own.lambda_:g}"
    return {**plan.settings, **changed}


def grid(plan: Plan) -> list[str]:
    """Names of the grounds that can be had under the plan's law, each ground once."""
    seen: list[dict[str, Any]] = []
    found = []
    for name in GROUNDS:
        settings = settings_on(plan, name)
        if settings is not None:
            plain = json.loads(json.dumps({**settings, "sand": dataclasses.asdict(make_sand(settings["sand"]))}))
            plain["sand"].pop("source")
            if plain not in seen:
                seen.append(plain)
                found.append(name)
    return found


def play(
    task: str, settings: Mapping[str, Any], maker: actors.Maker, n: int, *, seed: int, threads: int = 0
) -> list[dict[str, float]]:
    """Play n episodes side by side, episode i seeded with seed + i, and return what each came to."""
    asked = tasks.make(task, dict(settings))
    episodes = Episodes(asked, Many(ground.lay(asked), n, threads))
    actor, tally, running = maker(episodes), Tally(n), np.ones(n, dtype=bool)
    early = np.zeros(n, dtype=bool)
    episodes.restart(range(n), [gym.utils.seeding.np_random(seed + i)[0] for i in range(n)])
    seen, k = episodes.observation(), 0
    while running.any():
        action = np.where(running[:, None], actor(np.nan_to_num(seen), k * asked.config.period), 0.0)
        out = episodes.step(action)
        tally.add(out, running)
        early |= running & out.terminated & ~out.info["reached"].astype(bool)
        running &= ~(out.terminated | out.truncated)
        seen, k = out.observation, k + 1
    return [{**tally.take(i), "early": float(early[i])} for i in range(n)]


def score(path: "str | Path", name: str, n: int, seed: int, threads: int = 0, baselines: bool = False) -> list[Score]:
    """Score a run's policy on a ground, and with `baselines` random actions and the best drive that sees nothing.

    Returns:
        A score for each actor; none where the ground cannot be had under the run's law.
    """
    folder = Folder(path)
    plan = folder.plan()
    settings = settings_on(plan, name)
    if settings is None:
        return []
    found = [Score(name, POLICY, play(plan.task, settings, actors.trained(folder), n, seed=seed, threads=threads))]
    return found + (score_baselines(plan.task, settings, name, n, seed=seed, threads=threads) if baselines else [])


def score_baselines(
    task: str, settings: Mapping[str, Any], name: str, n: int, *, seed: int, threads: int = 0
) -> list[Score]:
    """Score those whom a policy has to beat: random actions, and the best of the task's drives that see nothing."""
    found = [Score(name, RANDOM, play(task, settings, actors.at_random(seed), n, seed=seed, threads=threads))]
    drives = tasks.make(task, dict(settings)).open_loops()
    if drives:

        def tried(label: str) -> float:
            few = play(task, settings, actors.open_loop(drives[label]), min(n, SEARCHED), seed=seed, threads=threads)
            return float(np.mean([one["r"] for one in few]))

        best = max(drives, key=tried)
        episodes = play(task, settings, actors.open_loop(drives[best]), n, seed=seed, threads=threads)
        found.append(Score(name, OPEN_LOOP, episodes, best))
    return found


def runs(path: "str | Path") -> list[Path]:
    """The runs in a folder: itself, or those one level below it.

    Raises:
        TrainingError: There are none.
    """
    folder = Path(path)
    found = [folder] if Folder(folder).exists else sorted(p.parent for p in folder.glob("*/config.json"))
    if not found:
        raise TrainingError(f"{folder} holds no training run: neither it nor a folder in it has a config.json")
    return found


def pooled(scores: Sequence[Score]) -> list[Score]:
    """Pool the scores of several runs: one per ground and kind of actor, over all episodes."""
    found: dict[tuple[str, str], Score] = {}
    for one in scores:
        key = one.ground, one.actor
        found[key] = Score(*key, [*(found[key].episodes if key in found else []), *one.episodes], one.which)
    return list(found.values())
