"""Physics of dm_control that advances by whole steps, as sand needs."""

import mujoco
from dm_control import mujoco as dm_mujoco


class WholeSteps(dm_mujoco.Physics):
    """Physics of dm_control whose steps are MuJoCo's own."""

    def step(self, nstep: int = 1) -> None:
        """Advance by whole steps, as the sand's force is solved for with the step's own controls in hand."""
        with self.check_invalid_state():
            mujoco.mj_step(self.model.ptr, self.data.ptr, nstep)
            if self.legacy_step:  # positions, velocities and the sand's force of where it has come to
                mujoco.mj_step1(self.model.ptr, self.data.ptr)
