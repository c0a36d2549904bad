"""A run as a Rerun recording: the bodies, what the sand does to them, and any scalars, over simulated time."""

import math
import types
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Final, Self

import mujoco
import rerun as rr

from rftsim.errors import RftsimError
from rftsim.view.contents import blueprint, scalar_entity, send
from rftsim.view.frames import Frame, describe, note_ground, sample
from rftsim.view.recording_file import check_recordable, write_verified

GROUND_PERIOD: Final = 0.1
"""Simulated time between two looks at the ground [s]."""


class Recorder:
    """Records one MuJoCo simulation for the Rerun viewer.

    Under `world`: the geoms (not planes and height fields, which have no end), the surfaces that feel the sand coloured
    by traction, an arrow of the sand's force on each body from the surface above where it acts, and the sand's surface.
    A plane follows the bodies in whole cells of its grid. Of terrain, and of sand that keeps marks, what is around the
    bodies is kept in tiles that stay, and each is recorded again when it has changed. Under `sand`: force [N], moment
    about the body's origin [N m] and depth of the deepest triangle [m] of each body, and the total power [W]. Under
    `speed`: that of each root body [m/s]. All are those of the last mj_forward or mj_step of the data. `about` states
    the scales, which are those of the whole recording.

    Frames stay in memory, some 4 bytes per triangle each, and 2.5 kB for each tile that changed, ten times a second,
    until `close` writes the file. An error inside the with-block does so too: the frames before it show what went
    wrong. Being stopped does not. When a reset turns time back, the recording goes on one period after its last frame.

    Args:
        model: A compiled model, with or without sand.
        path: The file, `*.rrd`; one that exists is replaced at `close`.
        application_id: The name under which the viewer groups recordings.
        fps: Frames per second of simulated time.

    Attributes:
        path: The file.
        frames: How many frames were recorded.

    Raises:
        RftsimError: The path cannot be written.
    """

    def __init__(
        self, model: mujoco.MjModel, path: "str | Path", application_id: str = "rftsim", fps: float = 50.0
    ) -> None:
        if not 0.0 < fps < math.inf:
            raise RftsimError(f"fps must be positive and finite, not {fps:g}")
        self.path = Path(path).resolve()
        check_recordable(self.path)
        self._application_id, self._period, self._shift = application_id, 1.0 / fps, 0.0
        self._portrait = describe(model)
        self._frames: list[Frame] = []
        self._looked = -math.inf
        self._scalars: dict[str, list[tuple[float, float]]] = {}
        self._closed = False

    @property
    def frames(self) -> int:
        """How many frames have been recorded so far."""
        return len(self._frames)

    def log(self, data: mujoco.MjData, scalars: Mapping[str, float] | None = None) -> bool:
        """Record a frame, unless the last one is less than a period ago.

        Args:
            data: The model's data.
            scalars: More values of this frame, by path: `command/speed`. The first element groups them into plots.

        Returns:
            Whether a frame was recorded.

        Raises:
            RftsimError: The recorder is closed, or a scalar's path is one of its own.
        """
        if self._closed:
            raise RftsimError(f"the recorder of {self.path} is closed")
        time, last = data.time + self._shift, self._frames[-1].time if self._frames else -math.inf
        if time < last:
            self._shift = last + self._period - data.time
            time = last + self._period
        elif time - last < self._period * (1.0 - 1e-6):  # sums of time steps are not exact
            return False
        extra = {scalar_entity(path): float(value) for path, value in (scalars or {}).items()}
        self._frames.append(sample(self._portrait, data, time))
        if time - self._looked >= GROUND_PERIOD * (1.0 - 1e-6):
            note_ground(self._portrait, data, time)
            self._looked = time
        for entity, value in extra.items():
            self._scalars.setdefault(entity, []).append((time, value))
        return True

    def close(self) -> None:
        """Write the file beside its place, read it back and put it there; does nothing a second time.

        Raises:
            RftsimError: Frames are missing from the file, as on a full disk; what was at the path is left as it was.
        """
        if self._closed:
            return
        self._closed = True
        stream = rr.RecordingStream(self._application_id, recording_id=uuid.uuid4())
        memory = stream.memory_recording()  # unlike save, which on a full disk goes on, or waits for ever
        stream.send_recording_name(self.path.stem)
        stream.send_blueprint(blueprint(self._portrait, self._scalars))
        rows = send(stream, self._portrait, self._frames, self._scalars)
        write_verified(memory.drain_as_bytes(), rows, self.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: types.TracebackType | None
    ) -> None:
        if kind is None or issubclass(kind, Exception):
            self.close()
