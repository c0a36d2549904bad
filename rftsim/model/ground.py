"""The sand's surface as it is in a model and its data."""

import mujoco

from rftsim.model.readout import instances
from rftsim.sand.free_surface import FreeSurface, GroundLike


def ground(model: mujoco.MjModel, data: mujoco.MjData, bed: str | None = None) -> GroundLike:
    """The surface of a bed of sand, by default of the first."""
    (found,) = [one for one in instances(model) if bed in (None, one.name)][:1]
    return FreeSurface(float(found.bed.offset / found.bed.up[2]), tuple(found.bed.up.tolist()))
