"""The part of a body's frame that does not change within a step, as numbers that last as long as the step."""

from collections import namedtuple
from typing import Final

import numpy as np

from rftsim.law.frame import Frame
from rftsim.law.layout import numbers_in
from rftsim.law.vectors import nine, to_body
from rftsim.machine.compiling import inline
from rftsim.machine.records import record_at, values_at

STEP_FRAME: Final = np.dtype(
    [
        *(
            ("up", "f8", 3),
            ("rise", "f8", 3),
            ("forward", "f8", 3),
            ("height", "f8"),
            ("rear", "f8", 4),
            ("drop", "f8"),
        ),
        *(("relief", "f8"), ("place", "f8", 3), ("moved", "f8", 6)),
    ]
)
"""The fields of a Frame but for the motion and the rotation."""
STEP_FRAME_NUMBERS: Final = numbers_in(STEP_FRAME)
_Values = namedtuple("_Values", STEP_FRAME.names)  # type: ignore[misc, arg-type]
_record_at, _values_at = record_at(STEP_FRAME), values_at(STEP_FRAME, _Values)


@inline
def keep(frame, address):
    """Write the lasting part of a frame to an address."""
    kept = _record_at(address)
    for k in range(3):
        kept.up[k], kept.rise[k], kept.forward[k] = frame.up[k], frame.rise[k], frame.forward[k]
        kept.place[k], kept.moved[k], kept.moved[3 + k] = frame.place[k], frame.moved[k], frame.moved[3 + k]
    for k in range(4):
        kept.rear[k] = frame.rear[k]
    kept.height, kept.drop, kept.relief = frame.height, frame.drop, frame.relief


@inline
def moving(address, xmat, twist):
    """The frame at an address of a body that moves with a twist, velocity first, world axes."""
    f = _values_at(address)
    v0 = to_body(xmat, twist[0], twist[1], twist[2])
    omega = to_body(xmat, twist[3], twist[4], twist[5])
    turn = nine(xmat)
    return Frame(v0, omega, f.up, f.rise, f.forward, f.height, f.rear, f.drop, f.relief, f.place, turn, f.moved)
