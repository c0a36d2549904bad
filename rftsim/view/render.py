"""Pictures of a model on sand: the scene as MuJoCo draws it, with haze, and the sand's forces before it."""

import types
from pathlib import Path
from typing import Final, Self, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from rftsim.view.cameras import SIZE, Camera, as_free, framing
from rftsim.view.canvas import SKY, Canvas, Shot
from rftsim.view.drawing import FORCES, Drawing, Shown
from rftsim.view.fields import Fields
from rftsim.view.look import CLEAR, WIDE, horizon, make_solid, painted, period, sand_geoms, shine, veil

Picture: TypeAlias = NDArray[np.uint8]
"""A picture, shape (height, width, 3)."""
_GEOM = mujoco.mjtGeom
BURIED: Final = 0.45
"""Share with which what is buried shows through the sand, where it is asked for."""
ARROWS: Final = 0.85
"""Share with which arrows show through everything."""


class Pictures:
    """Takes pictures of one model on sand; closes as a context.

    The sand hides what is buried, unless that is asked for. Arrows, of the sand's force on each body and of its
    tractions, show through everything. Of the model, height fields that draw the sand are changed, as the sand changes
    and the bodies move; nothing else is.

    Args:
        model: Compiled, with or without sand.
        width: Width of the pictures [pixels], of any size.
        height: Height of the pictures [pixels], of any size.
        shown: The arrows that are drawn, and whether what is buried shows.

    Raises:
        RftsimError: There is no OpenGL to draw with.
    """

    def __init__(
        self, model: mujoco.MjModel, width: int = SIZE[0], height: int = SIZE[1], shown: Shown = FORCES
    ) -> None:
        self._aspect, self._model, self._shown = width / height, model, shown
        self._drawing, self._ground, self._sky = Drawing(model), Fields(model), horizon(model)
        with painted(model):
            self._canvas = Canvas(model, width, height, self._drawing.extent)
        self._sand = sand_geoms(model).keys()
        self._hidden = {int(geom) for geom in np.flatnonzero(_endless(model))} | self._sand

    def take(self, data: mujoco.MjData, camera: "Camera | None" = None) -> Picture:
        """Draw the model as of the last mj_forward or mj_step of its data; the picture has shape (height, width, 3).

        Args:
            data: The model's data.
            camera: A camera; by default one that shows everything that can move.
        """
        if camera is None:
            tips = [arrow.tip for arrow in self._drawing.forces(data)] if self._shown.forces else []
            camera = framing(self._model, data, self._aspect, tips)
        self._canvas.upload(self._model, self._ground.follow(data))
        self._update(data, camera, mujoco.MjvOption())
        scene, extent = self._canvas.scene, self._drawing.extent
        geoms = [scene.geoms[i] for i in range(scene.ngeom)]
        ours = [geom for geom in geoms if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM]
        for geom in ours:
            if geom.objid in self._sand and geom.type == _GEOM.mjGEOM_PLANE:
                make_solid(geom, period(self._model, geom.objid), extent, scene.camera[0].pos)
        shine(scene)
        picture = veil(self._canvas.shoot(), self._sky, CLEAR * extent)
        if self._shown.buried and self._sand:
            for geom in ours:
                if geom.objid in self._hidden:
                    _vanish(geom)
            picture = _shine_through(picture, self._canvas.shoot(plain=True), BURIED)
        if self._shown.forces or self._shown.tractions:
            picture = self._add_arrows(picture, data, camera)
        return picture

    def _update(self, data: mujoco.MjData, camera: Camera, option: mujoco.MjvOption) -> None:
        """Fill the scene with what there is of the model under some options."""
        scene, every = self._canvas.scene, int(mujoco.mjtCatBit.mjCAT_ALL)
        perturb, eye = mujoco.MjvPerturb(), as_free(self._model, camera)
        mujoco.mjv_updateScene(self._model, data, option, perturb, eye, every, scene)
        for one in scene.camera:
            one.frustum_far = max(one.frustum_far, 4.0 * WIDE * self._drawing.extent / SKY)

    def _add_arrows(self, picture: Picture, data: mujoco.MjData, camera: Camera) -> Picture:
        """The picture with arrows over it."""
        self._update(data, camera, _nothing())
        scene = self._canvas.scene
        self._drawing.draw(scene, data, self._shown)
        legend = self._drawing.legend if self._shown.tractions else None
        return _shine_through(picture, self._canvas.shoot(legend, plain=True), ARROWS)

    def close(self) -> None:
        """Let go of what the pictures need."""
        self._canvas.close()

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
    shown: Shown = FORCES,
) -> Picture:
    """Draw a model on sand, see `Pictures`; the picture has shape (height, width, 3).

    Args:
        model: Compiled, with or without sand.
        data: Its data after mj_forward or mj_step.
        camera: A camera; by default one that shows everything that can move.
        width: Width of the picture [pixels].
        height: Height of the picture [pixels].
        shown: The arrows that are drawn, and whether what is buried shows.
    """
    with Pictures(model, width, height, shown) as pictures:
        return pictures.take(data, camera)


def save_picture(pictures: Pictures, data: mujoco.MjData, path: Path) -> None:
    """Take a picture of everything that can move, as of the last step of its data, and write it to a file."""
    picture = pictures.take(data)
    import matplotlib.image

    matplotlib.image.imsave(path, picture)


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


def _shine_through(whole: Picture, bare: Shot, share: float) -> Picture:
    """Mix a picture with a shot, of a share, where that shows something."""
    there = bare.colours.any(axis=2)
    solid, square = np.isfinite(bare.distance), np.ones((3, 3), bool)
    text = there & ~binary_dilation(solid, square)
    there |= binary_dilation(text, square) & ~solid  # the black edge of letters
    mixed = (1.0 - share) * whole[there] + share * bare.colours[there]
    picture = whole.copy()
    picture[there] = mixed.round()
    return picture
