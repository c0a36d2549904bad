"""Pictures of a model on sand: the scene as MuJoCo draws it, what is buried showing through, and the sand's forces."""

import math
import types
import warnings
from pathlib import Path
from typing import Final, Self, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from rftsim.errors import RftsimError
from rftsim.model.readout import instances
from rftsim.surface.triangles import Array
from rftsim.view.bounds import bounds, corners
from rftsim.view.drawing import ALL, Drawing, Shown
from rftsim.view.look import make_solid, repeats, roomy

Picture: TypeAlias = NDArray[np.uint8]
"""A picture, shape (height, width, 3)."""
Camera: TypeAlias = int | str | mujoco.MjvCamera
"""Id or name of a camera of the model, or a free camera."""
_GEOM = mujoco.mjtGeom
SIZE: Final = (960, 540)
"""Width and height of a picture [pixels]."""
BURIED: Final = 0.45
"""Share with which what is buried shows through the sand; what is not is the same in both."""
FORCES: Final = 0.85
"""Share with which the arrows of forces show through everything."""
FILLED: Final = 0.8
"""Share of the picture that the model takes, in height or in width."""
AZIMUTH: Final = 118.0
"""Direction in which a picture's camera looks, from the x axis on [degrees]."""
ELEVATIONS: Final = (-16.0, -24.0, -32.0, -45.0, -60.0)
"""Angles by which it may look up [degrees]; the first from which it is well above the sand."""
ABOVE: Final = 0.4
"""Height over the sand at which it is well above it, over the extent of what can move."""


class Pictures:
    """Takes pictures of one model on sand; closes as a context.

    What is buried shows through the sand. Arrows are the sand's force on each body, before all else; lines are its
    tractions.

    Args:
        model: Compiled, with or without sand.
        width: Width of the pictures [pixels], of any size.
        height: Height of the pictures [pixels], of any size.
        shown: The arrows that are drawn.

    Raises:
        RftsimError: There is no OpenGL to draw with.
    """

    def __init__(self, model: mujoco.MjModel, width: int = SIZE[0], height: int = SIZE[1], shown: Shown = ALL) -> None:
        self._aspect = width / height
        self._drawing, self._shown = Drawing(model), shown
        self._renderer = _renderer(model, self._drawing.extent, width, height)
        self._sand = repeats(model, self._drawing.extent)
        self._hidden = {int(geom) for geom in np.flatnonzero(_endless(model))} | set(self._sand)

    def take(self, data: mujoco.MjData, camera: "Camera | None" = None) -> Picture:
        """Draw the model as of the last mj_forward or mj_step of its data; the picture has shape (height, width, 3).

        Args:
            data: The model's data.
            camera: A camera; by default one that shows everything that can move.
        """
        if camera is None:
            camera = framing(self._drawing.model, data, self._aspect)
        scene = self._renderer.scene
        self._renderer.update_scene(data, camera)
        mine = [i for i in range(scene.ngeom) if scene.geoms[i].objtype == mujoco.mjtObj.mjOBJ_GEOM]
        self._drawing.draw(scene, data, self._shown)
        for geom in (scene.geoms[i] for i in mine if scene.geoms[i].objid in self._sand):
            make_solid(geom, self._sand[geom.objid], self._drawing.extent, scene.camera[0].pos)
        whole: Picture = self._renderer.render().copy()
        if self._sand:
            for geom in (scene.geoms[i] for i in mine if scene.geoms[i].objid in self._hidden):
                _vanish(geom)
            whole = _shine_through(whole, self._alone(), BURIED)
        if self._shown.forces:
            self._renderer.update_scene(data, camera, _nothing())
            self._drawing.draw(scene, data, self._shown._replace(tractions=False))
            whole = _shine_through(whole, self._alone(), FORCES)
        return whole

    def _alone(self) -> Picture:
        """The picture of what is in the scene now, on black."""
        flags, sky = self._renderer.scene.flags, int(mujoco.mjtRndFlag.mjRND_SKYBOX)
        kept = flags[sky]
        flags[sky] = False
        picture: Picture = self._renderer.render()
        flags[sky] = kept
        return picture

    def close(self) -> None:
        """Let go of what the pictures need."""
        self._renderer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: types.TracebackType | None
    ) -> None:
        self.close()


def render(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    *,
    camera: "Camera | None" = None,
    width: int = SIZE[0],
    height: int = SIZE[1],
    shown: Shown = ALL,
) -> Picture:
    """Draw a model on sand, see `Pictures`; the picture has shape (height, width, 3).

    Args:
        model: Compiled, with or without sand.
        data: Its data after mj_forward or mj_step.
        camera: A camera; by default one that shows everything that can move.
        width: Width of the picture [pixels].
        height: Height of the picture [pixels].
        shown: The arrows that are drawn.
    """
    with Pictures(model, width, height, shown) as pictures:
        return pictures.take(data, camera)


def framing(model: mujoco.MjModel, data: mujoco.MjData, aspect: float = SIZE[0] / SIZE[1]) -> mujoco.MjvCamera:
    """Make a free camera that shows everything that can move, from the side and slightly from above.

    Args:
        model: Compiled.
        data: Its data after mj_forward or mj_step.
        aspect: Width over height of the picture.
    """
    camera = mujoco.MjvCamera()
    camera.azimuth = AZIMUTH
    camera.lookat[:], extent = bounds(model, data)
    tangent = FILLED * np.tan(0.5 * np.radians(model.vis.global_.fovy))
    arms = corners(model, data) - camera.lookat
    for camera.elevation in ELEVATIONS:
        ahead, right, up = _axes(camera)
        wanted = np.maximum(np.abs(arms @ up) / tangent, np.abs(arms @ right) / (tangent * aspect)) - arms @ ahead
        camera.distance = max(float(wanted.max(initial=0.0)), 0.5 * extent)
        if _height(model, camera.lookat - camera.distance * ahead) > ABOVE * extent:
            break
    return camera


def save_picture(pictures: Pictures, data: mujoco.MjData, path: Path) -> None:
    """Take a picture of everything that can move, as of the last step of its data, and write it to a file."""
    picture = pictures.take(data)
    import matplotlib.image

    matplotlib.image.imsave(path, picture)


def _height(model: mujoco.MjModel, place: Array) -> float:
    """Height of a place over the highest sand [m]; infinite where there is none."""
    return min((float(one.bed.up @ place - one.bed.offset) for one in instances(model)), default=math.inf)


def _axes(camera: mujoco.MjvCamera) -> tuple[Array, Array, Array]:
    """Unit vectors ahead of a free camera, to its right and up, shape (3,) each."""
    turn, lift = np.radians([camera.azimuth, camera.elevation])
    ahead = np.array([np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)])
    right = np.array([np.sin(turn), -np.cos(turn), 0.0])
    return ahead, right, np.cross(right, ahead)


def _endless(model: mujoco.MjModel) -> "NDArray[np.bool_]":
    """Whether each geom is ground: a plane or height field that cannot move, shape (ngeom,)."""
    ground = np.isin(model.geom_type, [int(_GEOM.mjGEOM_PLANE), int(_GEOM.mjGEOM_HFIELD)])
    still: NDArray[np.bool_] = ground & (model.body_weldid[model.geom_bodyid] == 0)
    return still


def _vanish(geom: mujoco.MjvGeom) -> None:
    """Let nothing of a geom of a scene be seen."""
    geom.rgba[3], geom.transparent = 0.0, 1
    if geom.type in (_GEOM.mjGEOM_PLANE, _GEOM.mjGEOM_BOX):  # the sand is a box by now
        geom.size[:] = 1e-6


def _nothing() -> mujoco.MjvOption:
    """Make options under which a scene has cameras and lights and nothing of the model."""
    options = mujoco.MjvOption()
    for group in ("geom", "site", "joint", "tendon", "actuator", "flex", "skin"):
        getattr(options, f"{group}group")[:] = 0
    return options


def _shine_through(whole: Picture, bare: Picture, share: float) -> Picture:
    """Mix a picture with another one, of a share, where that is not black."""
    there = bare.any(axis=2, keepdims=True)
    return np.where(there, ((1.0 - share) * whole + share * bare).round(), whole).astype(np.uint8)


def _renderer(model: mujoco.MjModel, extent: float, width: int, height: int) -> mujoco.Renderer:
    """MuJoCo's renderer of a model, for pictures of any size."""
    with roomy(model, extent, width, height), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW's, which the error says better
        try:
            return mujoco.Renderer(model, height, width)
        except mujoco.FatalError as error:
            raise RftsimError(
                "no OpenGL to draw with: on a machine without a display set MUJOCO_GL=egl, or MUJOCO_GL=osmesa"
            ) from error
