"""A scene of MuJoCo and the buffer of OpenGL that it is drawn into, of any size."""

import warnings
from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rftsim.errors import RftsimError

SHADED: Final = 3.0
"""Half the width of what a distant light's shadows cover, over the extent of what can move."""
MOST: Final = 10_000
"""Most geoms in a scene."""
SKY: Final = 0.5
"""Share of the farthest distance that is drawn from which on all counts as sky, which MuJoCo draws as a near cube."""


class Shot(NamedTuple):
    """The colours that a camera sees, and how far away they are."""

    colours: NDArray[np.uint8]
    """Shape (height, width, 3)."""
    distance: NDArray[np.float32]
    """Distance along the view [m], shape (height, width); infinite where nothing is."""


class Canvas:
    """A scene of a model and what draws it.

    Args:
        model: Compiled.
        width: Width of the pictures [pixels], of any size.
        height: Height of the pictures [pixels], of any size.
        extent: The extent of what can move [m], which shadows fit.

    Attributes:
        scene: The scene, to be filled by the caller.

    Raises:
        RftsimError: There is no OpenGL to draw with.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int, extent: float) -> None:
        self._gl, self._context = _opengl(model, width, height)
        self.scene = mujoco.MjvScene(model, maxgeom=MOST)
        self._context.shadowClip = SHADED * extent
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        mujoco.mjr_resizeOffscreen(width, height, self._context)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._whole = mujoco.MjrRect(0, 0, width, height)

    def upload(self, model: mujoco.MjModel, height_fields: Iterable[int]) -> None:
        """Take over the heights of height fields from a model, by their ids."""
        self._gl.make_current()
        for one in height_fields:
            mujoco.mjr_uploadHField(model, self._context, one)

    def shoot(self, write: Callable[[Any], None] | None = None, *, plain: bool = False) -> Shot:
        """Draw the scene as it is.

        Args:
            write: Draws over the picture, with the context of OpenGL that it is given.
            plain: Draw no sky, and no shadows.
        """
        flags = (int(mujoco.mjtRndFlag.mjRND_SKYBOX), int(mujoco.mjtRndFlag.mjRND_SHADOW)) if plain else ()
        kept = self.scene.flags.copy()
        self.scene.flags[list(flags)] = 0
        shot = self._shoot(write)
        self.scene.flags[:] = kept
        return shot

    def _shoot(self, write: Callable[[Any], None] | None) -> Shot:
        self._gl.make_current()
        shape = self._whole.height, self._whole.width
        colours, nearness = np.empty((*shape, 3), np.uint8), np.empty(shape, np.float32)
        mujoco.mjr_render(self._whole, self.scene, self._context)
        if write is not None:
            write(self._context)
        mujoco.mjr_readPixels(colours, nearness, self._whole, self._context)
        camera = self.scene.camera[0]
        near, far = np.float32(camera.frustum_near), np.float32(camera.frustum_far)
        distance = near * far / (near + nearness * (far - near))
        distance[distance > SKY * far] = np.inf
        return Shot(colours[::-1], distance[::-1])

    def close(self) -> None:
        """Let go of OpenGL; does nothing a second time."""
        if self._gl is not None:
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._gl = None


def _opengl(model: mujoco.MjModel, width: int, height: int) -> tuple[Any, Any]:
    """A window of OpenGL that nobody sees, and what MuJoCo draws a model with in it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW's, which the error says better
        try:
            window = mujoco.GLContext(width, height)
            window.make_current()
            return window, mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150.value)
        except (AttributeError, mujoco.FatalError) as error:
            raise RftsimError(
                "no OpenGL to draw with: on a machine without a display set MUJOCO_GL=egl, or MUJOCO_GL=osmesa"
            ) from error
