"""Letting a robot settle in sand: from just above where it would stand, until it rests."""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from rftsim.model.readout import body_velocities
from rftsim.run.robot import Robot, measure
from rftsim.run.run import refuse_warnings
from rftsim.run.scenes import Staged
from rftsim.run.start import begin

ABOVE: Final = 0.02
"""Height from which it is dropped, over where it would stand, over its sinkage there."""
QUIET: Final = 0.25
"""Simulated time for which it has to rest [s]."""
SLOW: Final = 2e-3
"""Speed of every body below which it rests [m/s]."""
FALLEN: Final = 0.3
"""Share of its height by which the trunk may come down before it counts as fallen."""
TURNING: Final = 2e-2
"""Angular velocity of every body below which it rests [rad/s]."""


class Settled(NamedTuple):
    """A robot that was dropped, and whether it rests."""

    data: mujoco.MjData
    """MuJoCo's data at the end; at rest where it rests, but for what creeps."""
    rests: bool
    """Whether it came to rest within the time that it had."""
    robot: Robot
    """Its measures at the end."""
    fallen: float
    """How far its trunk came down from where it started, along the sand's normal [m]."""

    def doubts(self) -> list[str]:
        """Sentences that say what did not end as it was meant, with numbers."""
        found = []
        if not self.rests:
            found.append(f"it does not rest after {self.data.time:.3g} s: give it longer, or steadier controls")
        if self.fallen > FALLEN * (self.robot.height + self.fallen):
            found.append(f"its trunk came down by {self.fallen:.3g} m: its controls do not hold the pose")
        return found


def drop(staged: Staged, limit: float, observe: Callable[[mujoco.MjData], Any] | None = None) -> Settled:
    """Let a staged robot settle, its controls held.

    Args:
        staged: A scene that is to settle, or that falls from where it starts.
        limit: Simulated time after which it is given up [s].
        observe: Called with the data each time that was looked whether it rests.

    Raises:
        RunError: The simulation diverged.
    """
    model, data = staged.model, begin(staged, ABOVE)
    trunk = staged.measured.body
    height = measure(model, data, trunk).height
    moving = model.body_weldid != 0
    every = max(round(0.1 * QUIET / model.opt.timestep), 1)
    quiet = 0.0
    while data.time < limit and quiet < QUIET:
        mujoco.mj_step(model, data, nstep=every)
        refuse_warnings(data)
        linear, angular = (np.linalg.norm(v[moving], axis=1).max() for v in body_velocities(model, data))
        quiet = quiet + every * model.opt.timestep if linear < SLOW and angular < TURNING else 0.0
        if observe is not None:
            observe(data)
    robot = measure(model, data, trunk)
    return Settled(data, quiet >= QUIET, robot, height - robot.height)


def keyframe(settled: Settled, name: str = "settled") -> str:
    """The state of a settled robot as an MJCF keyframe; velocities only where it does not rest."""
    data = settled.data
    fields = {"qpos": data.qpos, "ctrl": data.ctrl, "act": data.act}
    if not settled.rests:
        fields |= {"qvel": data.qvel}
    if data.mocap_pos.size:
        fields |= {"mpos": data.mocap_pos.ravel(), "mquat": data.mocap_quat.ravel()}
    words = [
        f'{field}="{" ".join(f"{x + 0.0:.8g}" for x in values)}"' for field, values in fields.items() if len(values)
    ]
    return "\n".join(["<keyframe>", f'  <key name="{name}"', *(f"    {word}" for word in words), "  />", "</keyframe>"])
