"""The sand's forces drawn into a MuJoCo scene: a renderer's, a viewer's, or any other."""

from typing import Final, NamedTuple

import mujoco
import numpy as np

from rftsim.model.readout import instances, tractions
from rftsim.model.standing import moving_weight
from rftsim.surface.triangles import Array
from rftsim.view.bounds import bounds
from rftsim.view.forces import resultants

_GEOM = mujoco.mjtGeom
TRACTION_RGBA: Final = (0.80, 0.10, 0.08, 1.0)
"""Colour of the lines of the sand's traction."""
FORCE_RGBA: Final = (0.16, 0.47, 1.0, 1.0)
"""Colour of the arrows of the sand's force on a body."""
WEIGHT_LENGTH: Final = 0.8
"""Length of the arrow of a force as large as the weight, over the extent of what can move."""
LONGEST: Final = 1.0
"""Length of the longest arrow that is drawn, over the same."""
TRACTION_LENGTH: Final = 0.08
"""Length of the line of the largest traction, over the same."""
MOST: Final = 1500
"""Lines of tractions, about, at most; of more triangles every few has one."""
FAINTEST: Final = 0.01
"""Force, over the weight, below which none is drawn."""
FORCE_WIDTH: Final = 0.011
"""Half the width of a force's arrow, over the extent of what can move."""
TRACTION_WIDTH: Final = 2.0
"""Width of a traction's line [pixels]."""


class Shown(NamedTuple):
    """The parts of the sand's action that are drawn."""

    forces: bool = True
    """An arrow for the sand's force on each body, from the surface, with its size."""
    tractions: bool = True
    """A line for each triangle that the sand presses on, which ends where it acts."""


ALL: Final = Shown()
"""Everything that the sand does."""


class Drawing:
    """Draws the sand's forces on one model into scenes, to the scale of its size and weight.

    Args:
        model: Compiled, with sand.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        start = mujoco.MjData(model)
        mujoco.mj_kinematics(model, start)
        self.model = model
        self.extent = bounds(model, start)[1]
        self.weight = moving_weight(model)

    def draw(self, scene: mujoco.MjvScene, data: mujoco.MjData, shown: Shown = ALL) -> None:
        """Add to a scene what the sand does to the model, as of the last mj_forward or mj_step of its data.

        A scene that is full is left so.
        """
        if shown.forces:
            self._draw_forces(scene, data)
        if shown.tractions:
            self._draw_tractions(scene, data)

    def _draw_forces(self, scene: mujoco.MjvScene, data: mujoco.MjData) -> None:
        found = resultants(self.model, data)
        scale = self.weight or 2.0 * max((float(np.linalg.norm(one.force)) for one in found), default=0.0)
        for one in found:
            strength = float(np.linalg.norm(one.force))
            if strength <= FAINTEST * scale:
                continue
            length = self.extent * min(WEIGHT_LENGTH * strength / scale, LONGEST)
            tip = one.start + length / strength * one.force
            _add_arrow(scene, one.start, tip, FORCE_WIDTH * self.extent, FORCE_RGBA)
            _add_label(scene, tip, f"{strength:.3g} N")

    def _draw_tractions(self, scene: mujoco.MjvScene, data: mujoco.MjData) -> None:
        pressed = [tractions(self.model, data, body) for bed in instances(self.model) for body in bed.bodies]
        largest = max((float(np.linalg.norm(one.stress, axis=1).max()) for one in pressed), default=0.0)
        if largest == 0.0:
            return
        length = TRACTION_LENGTH * self.extent
        centres = np.concatenate([one.centre[one.active] for one in pressed])
        vectors = np.concatenate([one.stress[one.active] for one in pressed]) * (length / largest)
        drawn = np.flatnonzero(np.linalg.norm(vectors, axis=1) >= 0.05 * length)
        for i in drawn[:: -(-len(drawn) // MOST)]:
            _add_line(scene, centres[i] - vectors[i], centres[i], TRACTION_RGBA)  # it ends where it pushes


def _add_arrow(scene: mujoco.MjvScene, tail: Array, tip: Array, width: float, rgba: tuple[float, ...]) -> None:
    geom = _new_geom(scene, _GEOM.mjGEOM_ARROW, tail, rgba)
    if geom is not None:
        mujoco.mjv_connector(geom, _GEOM.mjGEOM_ARROW, width, tail, tip)
        geom.size[2] *= 2.0  # MuJoCo draws arrows half as long


def _add_line(scene: mujoco.MjvScene, tail: Array, tip: Array, rgba: tuple[float, ...]) -> None:
    geom = _new_geom(scene, _GEOM.mjGEOM_LINE, tail, rgba)
    if geom is not None:
        mujoco.mjv_connector(geom, _GEOM.mjGEOM_LINE, TRACTION_WIDTH, tail, tip)


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
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    scene.ngeom += 1
    return geom
