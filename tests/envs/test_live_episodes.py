"""Episodes live: how one follows the other, and what is seen of them on a display."""

import subprocess
import time

import mujoco
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from rftsim_envs.env import SandEnv
from rftsim_envs.training import actors
from rftsim_envs.training.live import LiveEpisodes
from test_training import call

import rftsim
from rftsim.view import live


def sand_in(picture):
    """The pixels that are brown, (n, 3)."""
    red, green, blue = np.moveaxis(picture.astype(int), 2, 0)
    return picture[(red > green) & (green > blue) & (red - blue > 20)]


def test_a_policys_episodes_are_seen_in_a_window_on_sand(display):
    """Much of the picture is brown of many shades, where an empty display is black."""
    asked = display.command("play", "Rover", "--actions", "random", "--set", "terrain=dunes", "ruts=true", "--live")
    with subprocess.Popen(asked, env=display.environment(), stderr=subprocess.DEVNULL) as process:
        try:
            until, sand = time.monotonic() + 120.0, np.empty((0, 3))
            while process.poll() is None and time.monotonic() < until and len(np.unique(sand, axis=0)) < 300:
                time.sleep(0.5)
                picture = display.shoot()
                sand = sand_in(picture)
        finally:
            process.terminate()
    assert len(sand) > 0.4 * picture.any(axis=2).sum() > 0


def test_episodes_follow_each_other_live_on_sand_as_strong_as_the_keys_made_it():
    env = SandEnv("FourFlapRunner", duration=0.2, strength=(0.5, 2.0))
    shown, still = LiveEpisodes(env, actors.zero, 7), mujoco.MjvPerturb()
    bed = rftsim.instances(env.model)[0].bed
    shown.press(live.UP)
    for _ in range(6):
        shown.advance(0.08, still)
    assert [one["l"] for one in shown.ended] == [10]
    assert shown.texts()[1].startswith("1, of seed 8\n")
    fresh = SandEnv("FourFlapRunner", duration=0.2, strength=(0.5, 2.0))
    fresh.reset(seed=8)
    drawn = rftsim.instances(fresh.model)[0].bed
    assert bed.xi_n == pytest.approx(live.FACTOR * drawn.xi_n)


def test_live_writes_no_files(capsys):
    code, _, err = call(capsys, "play", "Rover", "--live", "--picture", "rover.png")
    assert code == 2
    assert "--live goes on until its window is closed" in err
