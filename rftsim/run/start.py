"""The state in which a staged scene starts: in its keyframe, and where it floats as deep as it stands."""

import mujoco

from rftsim.model.poses import posed
from rftsim.model.standing import standing
from rftsim.run.scenes import Staged


def begin(staged: Staged, above: float = 0.0) -> mujoco.MjData:
    """Make the data with which a staged scene starts, after mj_forward.

    Args:
        staged: The scene.
        above: Height over where it stands, if it is to settle, over its largest sinkage.
    """
    model = staged.model
    data = posed(model, staged.start.keyframe)
    if staged.start.settle:
        data.qpos[:] = standing(model, data).raised(above)
    mujoco.mj_forward(model, data)
    return data
