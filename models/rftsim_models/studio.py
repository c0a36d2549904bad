"""Empty models with the options, the light and the sky that all models here share."""

import mujoco


def new_scene(name: str, *, gravity: float, timestep: float) -> mujoco.MjSpec:
    """An empty model by this name, lit and under a sky, which implicitfast integrates.

    Args:
        name: Name of the model.
        gravity: Acceleration along -z [m/s^2].
        timestep: Time step [s].
    """
    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.option.gravity = [0, 0, -gravity]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.timestep = timestep
    _furnish(spec)
    return spec


def _furnish(spec: mujoco.MjSpec) -> None:
    """Give a model a light whose shadows cover it and what is around it, a sky, and room for pictures of 1280 x 720."""
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 720
    spec.visual.map.shadowclip = 3.0
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    spec.visual.headlight.diffuse = [0.35, 0.35, 0.35]
    spec.worldbody.add_light(
        pos=[0, -1, 2], dir=[0.3, 0.6, -1], type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, diffuse=[0.5, 0.5, 0.5]
    )
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.55, 0.70, 0.88],
        rgb2=[0.95, 0.96, 0.98],
        width=256,
        height=256,
    )
