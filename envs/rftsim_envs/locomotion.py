"""`rftsim/Locomotion-v0`: a robot of one's own, from a model file, walks at a commanded velocity."""

import dataclasses
import warnings
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np

from rftsim.errors import RftsimNote
from rftsim_envs.physics import Array, Flags
from rftsim_envs.robot import Choice, Robot, read_robot, sole
from rftsim_envs.task import ConfigError, Moment
from rftsim_envs.walking import Walking, WalkingConfig

DOWN: Final = 0.4
"""Height of the base at which it is down, over that in the pose."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class LocomotionConfig(WalkingConfig):
    """Settings of a robot of one's own, beside those of walking.

    Attributes:
        model: Path of its MJCF or URDF file, or of a scene that it stands in; only the robot is taken.
        base: Body with the free joint; by default the one on which most hangs.
        joints: Joints that are driven, by name or pattern (`*_knee`), with commas between them; by default all.
        feet: Bodies that stand on the ground, by name or pattern; by default those that are lowest in the pose.
        keyframe: Keyframe that is the pose, by name or number; by default the first, or the model's initial pose.
        pose: Positions of joints in the pose, in place of the keyframe's: `*_HFE=0.4,*_KFE=-0.8` [rad or m].
        reach: Change of the targets of position servos for an action of 1: one for all, or one for each [rad or m].
        observe_feet: Let the observation end with the height of each foot's sole above the ground.
    """

    sand: str = "medium-sand"
    survival: float = 0.5
    model: str = ""
    base: str = ""
    joints: tuple[str, ...] = ()
    feet: tuple[str, ...] = ()
    keyframe: str = ""
    pose: tuple[str, ...] = ()
    reach: tuple[float, ...] = (0.35,)
    observe_feet: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.model:
            raise ConfigError(
                "Locomotion needs a robot: model takes the path of its MJCF or URDF, as model=go1/scene.xml"
            )
        object.__setattr__(self, "model", str(Path(self.model).resolve()))
        if not self.reach or min(self.reach) <= 0.0:
            raise ConfigError(f"reach must be positive, one number or one for each actuator, not {self.reach}")


class Locomotion(Walking):
    """A robot of one's own on legs, from an MJCF or URDF file, that follows a velocity in its own heading.

    Of the file only the robot is taken: the tree of bodies on its base. It starts in its keyframe, its lowest point on
    the ground, and is simulated by implicitfast. All that stands in the settings can be found instead: `base`,
    `joints`, `feet` and the pose; `robot` says what was.

    Action, a number for each actuator, in the order of the file, or of `joints`: the target of a servo of position less
    the pose, -1 to 1 for `reach` either way; and of any other actuator its range of controls.

    | observation | size | unit |
    |---|---|---|
    | commanded velocity ahead and to the left | 2 | m/s |
    | commanded yaw rate | 1 | rad/s |
    | gravity, in the base's axes | 3 | g |
    | linear velocity, in the base's axes | 3 | m/s |
    | angular velocity, in the base's axes | 3 | rad/s |
    | positions of the joints less the pose | njoints | rad or m |
    | rates of the joints | njoints | 10 rad/s or m/s |
    | last action | nactuators | - |
    | heights of the soles above the ground, if observe_feet | nfeet | length of the robot |

    Reward per second: velocity exp(-|v - commanded v|^2 / spread^2)
    + yaw exp(-(w - commanded w)^2 / turning_spread^2) + survival - energy P / (m g 1 m/s) - haste |a - last a|^2
    - tilt (g_x^2 + g_y^2) - crouch max(0, 1 - z / z_pose)^2, v the velocity over the ground in the heading's axes and w
    the yaw rate, both means over the control step as is the actuators' positive power P, z the height of the base above
    the ground, and g the direction of gravity in the base's axes.
    The episode ends in failure where the base leans 60 deg from the vertical, or its height above the ground is less
    than 0.4 of that in the pose.

    `info`: `speed`, ahead, `sideways` [m/s], `turning` [rad/s], `error`, of the velocity over the ground [m/s],
    `height` of the base [m], `tilt` from the vertical [rad], `sinkage` of the deepest foot, of the point that is its
    lowest in the pose [m], and what all tasks tell.

    Attributes:
        robot: What was read from the file.
    """

    Settings = LocomotionConfig
    training = dataclasses.replace(Walking.training, log_std_last=-2.5)
    config: LocomotionConfig

    def __init__(self, config: LocomotionConfig) -> None:
        super().__init__(config)
        choice = Choice(config.base, config.joints, config.feet, config.keyframe, config.pose)
        self.robot: Robot = read_robot(config.model, choice)
        self.joints, self.driven = self.robot.joints, self.robot.driven
        self.length = self.robot.length
        self.grounded = DOWN * self.robot.height
        warnings.warn(self._found(), RftsimNote, stacklevel=2)
        if len(config.reach) not in (1, self.naction):
            raise ConfigError(f"reach has {len(config.reach)} numbers, and actions {self.naction}: give 1 or as many")

    def _found(self) -> str:
        """The line that says what was taken for the robot."""
        r = self.robot
        return (
            f"{Path(self.config.model).name}: base {r.base}, {r.height:.3g} m high, feet {', '.join(r.feet)}; actions "
            f"drive {len(r.driven)} actuators, observed are {len(r.joints)} joints"
        )

    def options(self) -> dict[str, Any]:
        """Geoms as MuJoCo collides with them, in as few elements as the sand needs."""
        return {**super().options(), "meshes": "hull"}

    def build(self) -> mujoco.MjSpec:
        """The robot alone, whose first keyframe is its pose."""
        return self.robot.spec.copy()

    def prepare(self, model: mujoco.MjModel) -> None:
        """Look up, beside what walking needs, where the soles are told of in the sensors."""
        super().prepare(model)
        self._soles = np.array([model.sensor(sole(foot)).adr[0] + np.arange(3) for foot in self.robot.feet])

    def reach(self, model: mujoco.MjModel) -> tuple[Array, Array]:
        """The pose and `reach` of servos of position, the middle and half the range of other actuators, (naction,)."""
        ids = np.array([model.actuator(name).id for name in self.driven])
        servo = servos(model)[ids]
        low, high = model.actuator_ctrlrange[ids].T
        endless = ~servo & (model.actuator_ctrllimited[ids] == 0)
        if endless.any():
            names = ", ".join(np.array(self.driven)[endless])
            raise ConfigError(f"{names}: neither servos of position nor with a ctrlrange: give them one in the model")
        half = np.where(servo, self.config.reach, 0.5 * (high - low))
        return np.where(servo, model.key_ctrl[0][ids], 0.5 * (low + high)), half

    def observe(self, moment: Moment) -> Array:
        """The observation of the class's table, (n, nobservation)."""
        seen = super().observe(moment)
        return np.hstack([seen, self._clearance(moment) / self.length]) if self.config.observe_feet else seen

    def measures(self, moment: Moment) -> dict[str, Array]:
        """The measures of walking, and the sinkage of the deepest foot [m], (n,) each."""
        return super().measures(moment) | {"sinkage": -self._clearance(moment).min(axis=1)}

    def _clearance(self, moment: Moment) -> Array:
        """Heights of the soles above the ground [m], (n, nfeet)."""
        x, y, z = np.moveaxis(moment.sensors[:, self._soles], 2, 0)
        height: Array = z - moment.relief.height(x, y)
        return height


def servos(model: mujoco.MjModel) -> Flags:
    """Whether each actuator is a servo of position: a fixed gain, and a bias by its length, (nu,)."""
    fixed = model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED
    affine = model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE
    found: Flags = fixed & affine & (model.actuator_gainprm[:, 0] != 0.0) & (model.actuator_biasprm[:, 1] != 0.0)
    return found
