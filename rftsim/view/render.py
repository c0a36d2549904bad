"""Pictures of a model on sand: the scene as MuJoCo draws it, with the sand's traction as arrows."""

from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from rftsim.law.layout import extent
from rftsim.model.readout import instances, tractions
from rftsim.surface.triangles import Array

ARROW_RGBA = (0.75, 0.12, 0.10, 1.0)
"""Colour of the arrows of the sand's traction."""


def render(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    *,
    camera: "int | str | mujoco.MjvCamera" = -1,
    width: int = 960,
    height: int = 540,
    arrows: float = 0.0,
) -> NDArray[np.uint8]:
    """Draw a model as MuJoCo does; the picture has shape (height, width, 3).

    Args:
        model: A model with sand.
        data: Its data after mj_forward or mj_step.
        camera: Id or name of a camera of the model, or a free camera.
        width: Width of the picture [pixels]; at most that of the model's offscreen buffer.
        height: Height of the picture [pixels], likewise.
        arrows: Length of the arrow of the largest traction [m]; zero draws none.
    """
    options = mujoco.MjvOption()
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.update_scene(data, camera, options)
        if arrows > 0.0:
            draw_tractions(renderer.scene, model, data, arrows)
        picture: NDArray[np.uint8] = renderer.render().copy()
    return picture


def watching(model: mujoco.MjModel, data: mujoco.MjData, body: str) -> mujoco.MjvCamera:
    """Make a free camera that looks at a body from the side, slightly from above."""
    camera = mujoco.MjvCamera()
    camera.lookat[:] = data.xpos[model.body(body).id]
    own = [bed.bodies[model.body(body).id] for bed in instances(model) if model.body(body).id in bed.bodies]
    size = max((extent(surface) for surface in own), default=model.stat.extent)
    camera.distance, camera.azimuth, camera.elevation = 2.2 * size, 115.0, -14.0
    return camera


def save_picture(model: mujoco.MjModel, data: mujoco.MjData, body: str, path: Path) -> None:
    """Render a model, looking at a body, with arrows for the sand's traction, and write the picture to a file."""
    mujoco.mj_forward(model, data)
    camera = watching(model, data, body)
    picture = render(model, data, camera=camera, arrows=camera.distance / 10)
    import matplotlib.image

    matplotlib.image.imsave(path, picture)


def draw_tractions(scene: mujoco.MjvScene, model: mujoco.MjModel, data: mujoco.MjData, length: float) -> None:
    """Add an arrow per active triangle to a scene; the largest traction is `length` [m] long."""
    pressed = [tractions(model, data, body) for bed in instances(model) for body in bed.bodies]
    largest = max((np.linalg.norm(t.stress, axis=1).max() for t in pressed), default=0.0)
    if largest == 0.0:
        return
    for triangles in pressed:
        for centre, stress in zip(triangles.centre[triangles.active], triangles.stress[triangles.active], strict=True):
            vector = stress * (length / largest)
            if scene.ngeom < scene.maxgeom and np.linalg.norm(vector) >= 0.02 * length:
                _add_arrow(scene, centre - vector, centre, length / 40)  # it ends where it pushes


def _add_arrow(scene: mujoco.MjvScene, tail: Array, tip: Array, width: float) -> None:
    geom, arrow = scene.geoms[scene.ngeom], mujoco.mjtGeom.mjGEOM_ARROW
    mujoco.mjv_initGeom(geom, arrow, np.zeros(3), np.zeros(3), np.zeros(9), np.array(ARROW_RGBA, np.float32))
    mujoco.mjv_connector(geom, arrow, width, tail, tip)
    scene.ngeom += 1
