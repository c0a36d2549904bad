"""Recordings of a simulation's sand, bodies and forces, as Rerun shows them."""

import os
import uuid
from pathlib import Path

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rftsim_mpm.errors import MpmError
from rftsim_mpm.fields import StrainRate, in_slice
from rftsim_mpm.output import check_writable
from rftsim_mpm.simulation import Simulation

FRAMES_PER_SECOND = 30.0
"""Frames per simulated second, at first [1/s]."""
HALVE_EVERY = 200
"""Frames after which, each time, only half as many per second are taken from there on."""


class Recorder:
    """Particles coloured by the rate of plastic strain, bodies, and the forces on them; written when closed."""

    def __init__(self, path: Path) -> None:
        check_writable(path, ".rrd")
        self._path = path
        self._temporary = path.with_name(f".{path.stem}-{uuid.uuid4().hex[:8]}.rrd")
        self._stream = rr.RecordingStream("rftsim-mpm", make_default=False)
        self._stream.save(self._temporary)
        self._next, self._interval, self._frames = 0.0, 1.0 / FRAMES_PER_SECOND, 0
        self._rate = StrainRate()

    def log(self, sim: Simulation) -> None:
        """Record the present moment if a frame is due."""
        if sim.time < self._next:
            return
        self._frames += 1
        if self._frames % HALVE_EVERY == 0:
            self._interval *= 2.0
        self._next = sim.time + self._interval
        self._stream.set_time("sim_time", duration=sim.time)
        p = sim.particles
        rate = self._rate.since_last(sim)
        place = p.x if p.dim == 3 else np.insert(p.x, 1, 0.0, axis=1)
        seen = in_slice(sim)
        self._stream.log(
            "world/sand",
            rr.Points3D(
                place[seen], colors=_colours(rate[seen]), radii=0.5 * float(np.mean(p.volume)) ** (1.0 / p.dim)
            ),
        )
        self._log_bodies(sim)

    def _log_bodies(self, sim: Simulation) -> None:
        p = sim.particles
        for i, body in enumerate(sim.bodies):
            name = f"{i}-{body.shape.name}"
            if p.dim == 2:
                ring = np.insert(np.vstack([body.vertices, body.vertices[:1]]), 1, 0.0, axis=1)
                self._stream.log(f"world/{name}", rr.LineStrips3D([ring]))
            else:
                self._stream.log(
                    f"world/{name}", rr.Mesh3D(vertex_positions=body.vertices, triangle_indices=body.shape.faces)
                )
            for axis, force in zip("xyz" if p.dim == 3 else "xz", sim.force[i], strict=True):
                self._stream.log(f"force/{name}/{axis}", rr.Scalars(float(force)))

    def close(self) -> None:
        """End the recording and put it in its place."""
        self._stream.flush()
        self._stream.disconnect()
        try:
            os.replace(self._temporary, self._path)
        except OSError as error:
            raise MpmError(f"the recording could not be written to {self._path}: {error}") from error


def _colours(rate: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colours from sand's own at rest to dark red at the 98th percentile, (n, 3)."""
    share = np.clip(rate / max(float(np.percentile(rate, 98.0)), 1e-9), 0.0, 1.0)[:, None]
    found: NDArray[np.uint8] = ((1.0 - share) * [222, 203, 164] + share * [140, 20, 30]).astype(np.uint8)
    return found
