"""The path that a subject takes on sand, what it costs, and how far it is from another."""

import math
import time
from typing import Final, NamedTuple

import mujoco
import numpy as np

from rftsim.bench.subjects import Subject
from rftsim.model.readout import Work, work
from rftsim.run.scenes import Staged
from rftsim.surface.triangles import Array

REFERENCE_STEP: Final = 1e-4
"""Time step of the reference's path [s]."""
SAMPLE: Final = 1e-2
"""Time between two positions that are compared, and at which controls may be new [s]."""


class Followed(NamedTuple):
    """A path, and what it took."""

    path: Array
    """Positions of the measured body [m], shape (n, 3); nan once the simulation is lost."""
    seconds: float
    """Processor time of a step [s]."""
    work: Work
    """What the sand's force took, over all steps."""


def follow(subject: Subject, staged: Staged, h: float) -> Followed:
    """Step a subject from its start for its duration, at a time step [s]."""
    model = staged.model
    model.opt.timestep = h
    data, body = subject.start(model), model.body(staged.measured.body).id
    total, each = round(subject.duration / SAMPLE), round(SAMPLE / h)
    path, spent = np.full((total + 1, 3), np.nan), 0.0
    path[0] = data.xpos[body]
    for k in range(total):
        if subject.move is not None:
            data.ctrl[:] = subject.move(model, k * SAMPLE)
        started = time.thread_time()
        mujoco.mj_step(model, data, nstep=each)
        spent += time.thread_time() - started
        if any(warning.number for warning in data.warning):
            break
        mujoco.mj_kinematics(model, data)
        path[k + 1] = data.xpos[body]
    return Followed(path, spent / ((k + 1) * each), work(model, data))


def distance(path: Array, reference: Array) -> float:
    """Largest distance between two paths at the same time, over the length of the reference."""
    largest = np.linalg.norm(path - reference, axis=1).max()
    length = np.linalg.norm(np.diff(reference, axis=0), axis=1).sum()
    return float(largest / length) if np.isfinite(largest) else math.inf
