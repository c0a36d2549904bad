"""The sand's forces drawn into a MuJoCo scene: a renderer's, a viewer's, or any other."""

from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from rftsim.model.bounds import bounds
from rftsim.model.standing import moving_weight
from rftsim.surface.triangles import Array
from rftsim.view.colours import STOPS, shade
from rftsim.view.forces import resultants
from rftsim.view.tractions import FAINTEST as FAINTEST_TRACTION
from rftsim.view.tractions import patches, round_up, said

_GEOM = mujoco.mjtGeom
FORCE_RGBA: Final = (0.16, 0.47, 1.0, 1.0)
"""Colour of the arrows of the sand's force on a body."""
WEIGHT_LENGTH: Final = 0.5
"""Length of the arrow of a force as large as the weight, over the extent of what can move."""
LONGEST: Final = 0.7
"""Length of the longest arrow that is drawn, over the same."""
TRACTION_LENGTH: Final = 0.2
"""Length of the arrow of the largest traction of the scale, over the same."""
FAINTEST: Final = 0.01
"""Force, over the weight, below which none is drawn."""
FORCE_WIDTH: Final = 0.011
"""Half the width of a force's arrow, over the extent of what can move."""
TRACTION_WIDTH: Final = 0.006
"""Half the width of a traction's arrow, over the extent of what can move."""
GLOW: Final = 0.4
"""Light that arrows give off themselves, whatever the model's lights."""
SWATCH: Final = (26, 14)
"""Width and height of a colour in the legend [pixels]."""
MARGIN: Final = 14
"""Distance of the legend from the picture's edges [pixels]."""


class Shown(NamedTuple):
    """The parts of the sand's action that are drawn."""

    forces: bool = True
    """An arrow for the sand's force on each body, from the surface, with its size."""
    tractions: bool = False
    """An arrow for the traction on each patch that the sand presses on, which ends where it acts, and a legend."""
    buried: bool = False
    """What is buried, which shows through the sand; else the sand hides it."""


FORCES: Final = Shown()
"""The forces, on sand that hides what is buried."""
ALL: Final = Shown(True, True, True)
"""Everything that the sand does, and hides."""


class Arrow(NamedTuple):
    """The ends of an arrow that stands for a force, and how large that is."""

    tail: Array
    """Where it starts [m], shape (3,)."""
    tip: Array
    """Where it ends [m], shape (3,)."""
    strength: float
    """The force [N]."""


class Drawing:
    """Draws the sand's forces on one model into scenes, to the scale of its size and weight.

    Args:
        model: Compiled, with sand.

    Attributes:
        model: The model.
        extent: The extent of what can move [m].
        weight: Its weight [N].
        largest: Traction of the longest arrow and the darkest colour [Pa]: a round number, not below the largest
            that was drawn so far, so that the arrows of a film have one scale.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        start = mujoco.MjData(model)
        mujoco.mj_kinematics(model, start)
        self.model = model
        self.extent = bounds(model, start)[1]
        self.weight = moving_weight(model)
        self.largest = 0.0

    def draw(self, scene: mujoco.MjvScene, data: mujoco.MjData, shown: Shown = FORCES) -> None:
        """Add to a scene what the sand does to the model, as of the last mj_forward or mj_step of its data.

        A scene that is full is left so.
        """
        if shown.forces:
            self._draw_forces(scene, data)
        if shown.tractions:
            self._draw_tractions(scene, data)

    def forces(self, data: mujoco.MjData) -> list[Arrow]:
        """The arrows of the sand's force on each body, as of the last mj_forward or mj_step of the data."""
        found = [(one, float(np.linalg.norm(one.force))) for one in resultants(self.model, data)]
        scale = self.weight or 2.0 * max((strength for _, strength in found), default=0.0)
        arrows = []
        for one, strength in found:
            if strength > FAINTEST * scale:
                length = self.extent * min(WEIGHT_LENGTH * strength / scale, LONGEST)
                arrows.append(Arrow(one.start, one.start + length / strength * one.force, strength))
        return arrows

    def _draw_forces(self, scene: mujoco.MjvScene, data: mujoco.MjData) -> None:
        for tail, tip, strength in self.forces(data):
            _add_arrow(scene, tail, tip, FORCE_WIDTH * self.extent, FORCE_RGBA)
            _add_label(scene, tip, f"{strength:.3g} N")

    def _draw_tractions(self, scene: mujoco.MjvScene, data: mujoco.MjData) -> None:
        pressed = patches(self.model, data, self.extent)
        strength = np.linalg.norm(pressed.stress, axis=1)
        largest = float(strength.max(initial=0.0))
        if largest == 0.0:
            return
        self.largest = max(self.largest, round_up(largest))
        vectors, colours = (
            pressed.stress * (TRACTION_LENGTH * self.extent / self.largest),
            shade(strength / self.largest),
        )
        for i in np.flatnonzero(strength >= FAINTEST_TRACTION * largest):
            tip, width = pressed.centre[i], TRACTION_WIDTH * self.extent
            _add_arrow(scene, tip - vectors[i], tip, width, (*colours[i], 1.0))  # it ends where it pushes

    def legend(self, context: Any) -> None:
        """Write what the colours and lengths of tractions mean into the lower left corner of a picture.

        Args:
            context: MuJoCo's context of OpenGL, in which the picture has just been drawn.
        """
        if self.largest == 0.0:
            return
        width, height = SWATCH
        for k, colour in enumerate(np.array(STOPS) / 255.0):
            mujoco.mjr_rectangle(mujoco.MjrRect(MARGIN + k * width, MARGIN, width, height), *colour, 1.0)
        place = mujoco.MjrRect(MARGIN + len(STOPS) * width, MARGIN // 2, 400, 2 * height)
        text = f"traction, 0 to {said(self.largest)}"
        mujoco.mjr_overlay(mujoco.mjtFont.mjFONT_NORMAL, mujoco.mjtGridPos.mjGRID_BOTTOMLEFT, place, text, "", context)


def _add_arrow(scene: mujoco.MjvScene, tail: Array, tip: Array, width: float, rgba: tuple[float, ...]) -> None:
    geom = _new_geom(scene, _GEOM.mjGEOM_ARROW, tail, rgba)
    if geom is not None:
        mujoco.mjv_connector(geom, _GEOM.mjGEOM_ARROW, width, tail, tip)
        geom.size[2] *= 2.0  # MuJoCo draws arrows half as long


def _add_label(scene: mujoco.MjvScene, place: Array, text: str) -> None:
    geom = _new_geom(scene, _GEOM.mjGEOM_LABEL, place, (1.0, 1.0, 1.0, 1.0))
    if geom is not None:
        geom.label = text


def _new_geom(
    scene: mujoco.MjvScene, kind: mujoco.mjtGeom, place: Array, rgba: tuple[float, ...]
) -> mujoco.MjvGeom | None:
    """A new geom of a scene, or None where the scene is full."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, np.zeros(3), place, np.eye(3).ravel(), np.array(rgba, np.float32))
    geom.category, geom.emission = mujoco.mjtCatBit.mjCAT_DECOR, GLOW
    scene.ngeom += 1
    return geom
