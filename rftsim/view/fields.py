"""The height fields that draw a model's sand, kept as its surface is and where its bodies are."""

import math
from collections.abc import Sequence
from typing import Final

import mujoco
import numpy as np

from rftsim.law import layout
from rftsim.model.ground import Ground, ground
from rftsim.model.readout import Instance, instances
from rftsim.model.relief import Field, Level, centres, join_fields, sample_field
from rftsim.surface.triangles import Array
from rftsim.view.look import period, sand_geoms

SEEN: Final = 1e-3
"""Change of a height that is drawn, over the cell."""


class Fields:
    """The height fields of a model's beds, which `follow` the bodies and show the sand as it is in some data.

    Args:
        model: Compiled; of its elements `follow` writes those that draw sand, and no others.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        drawn = sand_geoms(model)
        self._beds = []
        for bed in instances(model):
            kind = int(mujoco.mjtGeom.mjGEOM_HFIELD)
            geoms = [geom for geom, name in drawn.items() if name == bed.name and model.geom_type[geom] == kind]
            if geoms:
                self._beds.append(_Bed(model, bed, geoms))

    def follow(self, data: mujoco.MjData) -> list[int]:
        """Take over the surface of the sand and the places of the bodies from the model's data.

        Of the model it changes heights and places of the height fields that draw the sand, in the data the places.

        Returns:
            Ids of the height fields that changed, which a viewer or a renderer has to take over: by `update_hfield` of
            MuJoCo's passive viewer, or by `mujoco.mjr_uploadHField`.
        """
        return [changed for bed in self._beds for changed in bed.follow(data)]


class _Bed:
    """The height fields of a bed, finest first."""

    def __init__(self, model: mujoco.MjModel, bed: Instance, geoms: Sequence[int]) -> None:
        self._model, self._bed = model, bed
        self._geoms = sorted(geoms, key=lambda geom: _level(model, geom).cell)
        self._levels = [_level(model, geom) for geom in self._geoms]
        cell = self._levels[0].cell
        self._grain = cell * 2.0 ** round(math.log2(period(model, self._geoms[0]) / cell))  # exactly, as it was made
        self._sampled: list[Field] = []
        self._numbers = np.empty(0)
        self._shown: list[Field | None] = [None] * len(self._geoms)
        self._places = np.array(model.geom_pos[self._geoms])
        model.geom_sameframe[self._geoms] = int(mujoco.mjtSameFrame.mjSAMEFRAME_NONE)

    def follow(self, data: mujoco.MjData) -> list[int]:
        surface = ground(self._model, data, self._bed.name)
        self._forget()
        around = centres(self._levels, self._focus(surface, data), self._grain)
        self._sampled = [
            sample_field(level, centre, surface.undisturbed_at if k else surface.height_at)
            if self._stale(k, centre)
            else self._sampled[k]
            for k, (level, centre) in enumerate(zip(self._levels, around, strict=True))
        ]
        fields = join_fields(self._levels, self._sampled)
        changed = [self._write(k, field) for k, field in enumerate(fields) if self._differs(k, field)]
        self._model.geom_pos[self._geoms] = data.geom_xpos[self._geoms] = self._places
        return changed

    def _focus(self, surface: Ground, data: mujoco.MjData) -> Array:
        """The middle of where marks are, or of the bodies where there are none, x and y [m]."""
        places: Array = data.xpos[list(self._bed.bodies), :2]
        if surface.window is not None and layout.ruts_size(self._bed.bed):
            places = np.array(surface.window)
        return np.asarray(places.mean(axis=0))

    def _forget(self) -> None:
        """Forget what was looked up of a surface that has been moved, or changed in place, since."""
        bed = self._bed
        numbers = np.array([bed.bed.offset, *bed.bed.up, *(() if bed.relief is None else bed.relief)])
        if not np.array_equal(numbers, self._numbers):
            self._sampled, self._numbers = [], numbers

    def _stale(self, k: int, centre: Array) -> bool:
        """Whether a field has to be looked up: the finest, which alone shows marks, always; others at another place."""
        return k == 0 or not self._sampled or (self._sampled[k].centre != centre).any()

    def _differs(self, k: int, field: Field) -> bool:
        """Whether a field is another than the one that is drawn."""
        shown = self._shown[k]
        if shown is None or (shown.centre != field.centre).any():
            return True
        return bool(np.abs(shown.heights - field.heights).max() > SEEN * self._levels[k].cell)

    def _write(self, k: int, field: Field) -> int:
        """Draw a field from here on; the id of its height field."""
        model, shown = self._model, self._shown[k]
        one = int(model.geom_dataid[self._geoms[k]])
        if shown is None or (shown.centre != field.centre).any():
            self._places[k] = *field.centre, field.heights.min()
        values = (field.heights - self._places[k, 2]) / model.hfield_size[one, 2]
        model.hfield_data[model.hfield_adr[one] :][: values.size] = values.ravel()
        self._shown[k] = field
        return one


def _level(model: mujoco.MjModel, geom: int) -> Level:
    """The size of the field that a geom draws."""
    one = model.geom_dataid[geom]
    cells = int(model.hfield_ncol[one]) - 1
    return Level(cells, 2.0 * float(model.hfield_size[one, 0]) / cells)
