"""Whether a step is in the range in which resistive force theory holds, cheaply enough to ask at each one."""

import numpy as np
from numpy.typing import NDArray

from rftsim.law.layout import HEADER, record
from rftsim.model.readout import instances
from rftsim.run.validity import DEPTH_LIMIT, FROUDE_LIMIT
from rftsim_envs.physics import Physics
from rftsim_envs.relief import Relief
from rftsim_envs.task import cross


class Limits:
    """The numbers of `rftsim.validity`, from the boxes around the bodies that feel the sand, not their triangles."""

    def __init__(self, physics: Physics, relief: Relief) -> None:
        self._relief = relief
        beds = instances(physics.model)
        self._bodies = [body for bed in beds for body in bed.bodies]
        if not self._bodies:
            return
        headers = [record(surface, HEADER) for bed in beds for surface in bed.bodies.values()]
        low, high = np.array([one.lowest for one in headers]), np.array([one.highest for one in headers])
        self._centre, self._half = 0.5 * (low + high), 0.5 * (high - low)
        self._size = 2.0 * self._half.max(axis=1)
        self._dynamic = bool(beds[0].bed.dynamic)
        self._limit = np.sqrt(beds[0].bed.g * self._size)
        self._place, self._turn = physics.field("xpos"), physics.field("xmat")
        self._velocity, self._com = physics.field("cvel"), physics.field("subtree_com")
        self._roots = physics.model.body_rootid[self._bodies]

    def measures(self) -> dict[str, NDArray[np.generic]]:
        """`froude` and `depth_ratio` [-], the largest of the bodies, and whether the law is `in_range`; (n,) each."""
        if not self._bodies:
            return {}
        turn = self._turn[:, self._bodies].reshape(-1, len(self._bodies), 3, 3)
        arm = np.einsum("nbij,bj->nbi", turn, self._centre)
        centre = self._place[:, self._bodies] + arm
        height = centre[:, :, 2] - self._relief.height(centre[:, :, 0], centre[:, :, 1])
        depth = np.einsum("nbi,bi->nb", np.abs(turn[:, :, 2]), self._half) - height
        twist = self._velocity[:, self._bodies]
        velocity = twist[..., 3:] + cross(twist[..., :3], centre - self._com[:, self._roots])
        touched = depth > 0.0
        speed = np.sqrt((velocity**2).sum(axis=2))
        froude = np.where(touched, speed / self._limit, 0.0).max(axis=1)
        ratio = np.where(touched, depth / self._size, 0.0).max(axis=1)
        in_range = (ratio <= DEPTH_LIMIT) & (self._dynamic | (froude <= FROUDE_LIMIT))
        return {"froude": froude, "depth_ratio": ratio, "in_range": in_range}
