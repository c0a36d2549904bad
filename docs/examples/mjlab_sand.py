"""Unitree's Go1 and G1 on sand, in mjlab's own velocity task.

python docs/examples/mjlab_sand.py train Rftsim-Velocity-Sand-Unitree-Go1 --env.scene.num-envs 4096
python docs/examples/mjlab_sand.py play Rftsim-Velocity-Sand-Unitree-Go1 --checkpoint-file logs/rsl_rl/.../model_50.pt

What stands behind train and play are mjlab's own commands.
"""

import math
import sys
from typing import Any, Final

import mujoco
import mujoco_warp as mjw
import torch
import warp as wp
from mjlab.entity import Entity
from mjlab.envs import ManagerBasedRlEnv, ManagerBasedRlEnvCfg
from mjlab.managers.event_manager import EventTermCfg
from mjlab.managers.manager_base import ManagerTermBase
from mjlab.scripts import play, train
from mjlab.sensor import ContactData, ContactSensor, ContactSensorCfg
from mjlab.sensor.contact_sensor import _ContactSlot
from mjlab.tasks.registry import register_mjlab_task
from mjlab.tasks.velocity.config.g1.env_cfgs import unitree_g1_flat_env_cfg
from mjlab.tasks.velocity.config.g1.rl_cfg import unitree_g1_ppo_runner_cfg
from mjlab.tasks.velocity.config.go1.env_cfgs import unitree_go1_flat_env_cfg
from mjlab.tasks.velocity.config.go1.rl_cfg import unitree_go1_ppo_runner_cfg
from mjlab.tasks.velocity.rl import VelocityOnPolicyRunner

import rftsim
from rftsim.warp import WarpSand

ROBOTS: Final = {
    "Go1": (unitree_go1_flat_env_cfg, unitree_go1_ppo_runner_cfg),
    "G1": (unitree_g1_flat_env_cfg, unitree_g1_ppo_runner_cfg),
}
"""The task on a plane and the settings of PPO of each robot."""
TOUCH: Final = 1.0
"""Force of the sand above which a foot stands in it [N]."""


class Sand(ManagerTermBase):
    """The sand of all worlds: laid when the environment starts, and without a past where a world is reset.

    Attributes:
        sand: The sand.
        xi_n: Its strength in each world [N/m³], (num_envs,), to be written in place.
        mu_surf: Its friction on the robot in each world, (num_envs,), to be written in place.
        medium: What it is where nothing is drawn.
    """

    def __init__(self, cfg: EventTermCfg, env: ManagerBasedRlEnv) -> None:
        """Lay the sand that the parameters `medium` and `law` name."""
        super().__init__(env)
        model, self.medium = with_sand(env.scene.spec, **cfg.params)
        with wp.ScopedDevice(env.sim.wp_device):
            self.sand = WarpSand(model, env.num_envs, onto=env.sim.mj_model)
            self.sand.attach(env.sim.wp_model)
            (bed,) = self.sand.beds
            bed.vary("xi_n", "mu_surf")
            self.xi_n, self.mu_surf = wp.to_torch(bed.sands.xi_n), wp.to_torch(bed.sands.mu_surf)
            self._gone = wp.zeros(env.num_envs, dtype=bool)
            mjw.forward(env.sim.wp_model, env.sim.wp_data)  # makes what the sand needs before a graph is captured

    def __call__(self, env: ManagerBasedRlEnv, env_ids: Any, **_: Any) -> None:
        """Capture the steps anew, with the sand in them."""
        env.sim.create_graph()

    def reset(self, env_ids: torch.Tensor | slice | None) -> None:
        """Let worlds that are reset forget what their sand went through."""
        gone = wp.to_torch(self._gone)
        gone[:] = env_ids is None
        if env_ids is not None:
            gone[env_ids] = True
        with wp.ScopedDevice(self._env.sim.wp_device):
            self.sand.reset(self._gone)


def with_sand(spec: mujoco.MjSpec, medium: str, law: str) -> tuple[mujoco.MjModel, rftsim.Sand]:
    """The scene with sand at z = 0, compiled for MuJoCo, and what the sand is."""
    own = spec.copy()
    for sensor in list(own.sensors):
        own.delete(sensor)
    bed = rftsim.add_sand(own, medium, law, terrain=0.0, sensors=False, draw=False)
    return own.compile(), bed.sand


def vary_sand(
    env: ManagerBasedRlEnv, env_ids: torch.Tensor, strength: tuple[float, float], friction: tuple[float, float]
) -> None:
    """Draw the sand of worlds: its strength over that of the medium, evenly in its logarithm, and its friction."""
    term: Sand = env.event_manager.get_term_cfg("sand").func
    draw = torch.rand(2, len(env_ids), device=env.device)
    low, high = (math.log(limit) for limit in strength)
    term.xi_n[env_ids] = term.medium.xi_n * torch.exp(low + (high - low) * draw[0])
    term.mu_surf[env_ids] = friction[0] + (friction[1] - friction[0]) * draw[1]


class SandContactSensor(ContactSensor):
    """A sensor of the contact of feet with the ground that reads the sand's force on the bodies that end in them."""

    def edit_spec(self, scene_spec: mujoco.MjSpec, entities: dict[str, Entity]) -> None:
        """Add a sensor of the sand's wrench for each foot, which `WarpSand` knows by its name."""
        self._slots.clear()
        match = self.cfg.primary
        for name in self._resolve_primary_names(entities, match):
            owner = f"{match.entity}/{name}"
            body = scene_spec.geom(owner).parent.name if match.mode == "geom" else owner
            scene_spec.add_sensor(
                name=f"{body}_sand",
                type=mujoco.mjtSensor.mjSENS_USER,
                objtype=mujoco.mjtObj.mjOBJ_BODY,
                objname=body,
                dim=6,
                needstage=mujoco.mjtStage.mjSTAGE_ACC,
            )
            self._slots.append(_ContactSlot(name, "force", f"{body}_sand"))

    def _extract_sensor_data(self) -> ContactData:
        force = torch.stack([slot.data_view[:, :3] for slot in self._slots], dim=1)
        return ContactData(found=(force.norm(dim=-1) > TOUCH).float(), force=force)


class SandContactSensorCfg(ContactSensorCfg):
    """The settings of a sensor of contact with rigid ground, for sand in its place."""

    def build(self) -> SandContactSensor:
        """The sensor of these settings, before it has a model."""
        return SandContactSensor(self)


def let_through(spec: mujoco.MjSpec) -> None:
    """Let the ground collide with nothing, as the sand takes its place; it stays to be seen, and for rays."""
    for geom in spec.body("terrain").geoms:
        geom.contype = geom.conaffinity = 0


def on_sand(cfg: ManagerBasedRlEnvCfg) -> ManagerBasedRlEnvCfg:
    """A task on a plane with sand in the place of the plane."""
    cfg.scene.spec_fn = let_through
    cfg.scene.sensors = tuple(
        SandContactSensorCfg(**vars(sensor)) if sensor.name == "feet_ground_contact" else sensor
        for sensor in cfg.scene.sensors
    )
    cfg.events = {name: event for name, event in cfg.events.items() if not name.startswith("foot_friction")}
    cfg.events["sand"] = EventTermCfg(func=Sand, mode="startup", params={"medium": "medium-sand", "law": "rft3d"})
    cfg.events["vary_sand"] = EventTermCfg(
        func=vary_sand, mode="reset", params={"strength": (0.5, 2.0), "friction": (0.25, 0.55)}
    )
    return cfg


def register() -> None:
    """Register the task of each robot with mjlab."""
    for robot, (env_cfg, rl_cfg) in ROBOTS.items():
        register_mjlab_task(
            f"Rftsim-Velocity-Sand-Unitree-{robot}",
            env_cfg=on_sand(env_cfg()),
            play_env_cfg=on_sand(env_cfg(play=True)),
            rl_cfg=rl_cfg(),
            runner_cls=VelocityOnPolicyRunner,
        )


def main() -> None:
    """Run mjlab's command that the first argument names, `train` or `play`, with these tasks known."""
    commands = {"train": train.main, "play": play.main}
    if len(sys.argv) < 2 or sys.argv[1] not in commands:
        sys.exit(f"usage: mjlab_sand.py {{{','.join(commands)}}} TASK [OPTION ...]")
    register()
    commands[sys.argv.pop(1)]()


if __name__ == "__main__":
    main()
