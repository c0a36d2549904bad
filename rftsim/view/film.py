"""Films of pictures, in MPEG-4 files."""

import contextlib
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from rftsim.errors import RftsimError

FPS: Final = 30.0
"""Pictures per second of a film."""
QUALITY: Final = {"crf": "18", "preset": "slow"}
"""Options of the encoder: sand is noise, of which it keeps little unless it is told to."""


@contextlib.contextmanager
def filming(path: Path, width: int, height: int) -> Iterator[Callable[[Any, float], None]]:
    """Film something: call what is given with what takes a picture, (height, width, 3), and the time [s] of the film.

    A picture is taken and stands from where the film ends to that time; none is where that is no later.

    Args:
        path: The file, *.mp4.
        width: Width of the pictures [pixels], even.
        height: Height of the pictures [pixels], even.

    Raises:
        RftsimError: It cannot be written.
    """
    import av  # an extra

    taken = 0
    try:
        with av.open(str(path), "w") as container:
            stream = container.add_stream("libx264", rate=round(FPS), options=dict(QUALITY))
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"

            def show(take: Callable[[], Any], time: float) -> None:
                nonlocal taken
                wanted = math.ceil(time * FPS - 1e-6) - taken
                picture = take() if wanted > 0 else None
                for _ in range(wanted):
                    for packet in stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")):
                        container.mux(packet)
                    taken += 1

            yield show
            for packet in stream.encode():
                container.mux(packet)
    except OSError as error:
        raise RftsimError(f"cannot write {path}: {error}") from error
