"""Surfaces and sand that no longer fit their model, because its geoms or its gravity were changed after the load."""

import warnings
import weakref
from collections.abc import Iterable
from typing import Any, Final

import mujoco
import numpy as np

from rftsim.errors import RftsimWarning
from rftsim.law import layout
from rftsim.model.geometry import bounding_geoms
from rftsim.surface.triangles import Array

CHANGED: Final = 1e-5
"""Change of a body's numbers, over their size, from which on its geoms are others: model files have six digits."""
FEW: Final = 3
"""Bodies that the doubt tells before it counts the others."""


_said: "weakref.WeakKeyDictionary[mujoco.MjModel, frozenset[str]]" = weakref.WeakKeyDictionary()
"""The doubts of each model that were told already."""


def tell_stale(model: mujoco.MjModel, surfaces: Iterable[tuple[int, Array]]) -> None:
    """Warn of what `stale_doubts` finds, once for each model."""
    doubts, told = stale_doubts(model, surfaces), _said.get(model, frozenset())
    if new := [doubt for doubt in doubts if doubt not in told]:
        _said[model] = told | frozenset(new)
        for doubt in new:
            warnings.warn(doubt, RftsimWarning, stacklevel=3)


def mark(model: mujoco.MjModel, body: int, packed: Array) -> None:
    """Write into a packed surface which geoms and which gravity it was made for, for `stale_doubts`."""
    header = layout.record(packed, layout.HEADER)
    header.made_from, header.gravity = _numbers(model, body)[0], model.opt.gravity


def stale_doubts(model: mujoco.MjModel, surfaces: Iterable[tuple[int, Array]]) -> list[str]:
    """The doubts about surfaces that were made from other geoms, and about stronger or weaker gravity, if any.

    Masses, joints and places of bodies may change: they are read from the model at each step.

    Args:
        model: Compiled, with sand.
        surfaces: Ids of bodies that feel the sand, and their packed surfaces.
    """
    changed, gravity = [], False
    for body, packed in surfaces:
        header = layout.record(packed, layout.HEADER)
        if header.made_from == 0.0:
            continue
        found, size = _numbers(model, body)
        if abs(found - header.made_from) > CHANGED * size:
            changed.append(model.body(body).name)
        pull = np.linalg.norm(header.gravity)  # turned gravity is a slope
        gravity |= bool(abs(pull - np.linalg.norm(model.opt.gravity)) > CHANGED * pull)
    doubts = []
    if changed:
        more = f" and {len(changed) - FEW} more" if len(changed) > FEW else ""
        doubts.append(
            f"geoms of {', '.join(changed[:FEW])}{more} were changed after the sand was added, which still presses on "
            "the surfaces that they had: change them in the spec or file, and add the sand then"
        )
    if gravity:
        doubts.append(
            "the strength of gravity was changed after the sand was added, whose own stays as it was: set "
            "instances(model)[k].bed.xi_n in proportion, or change it in the spec or file, and add the sand then"
        )
    return doubts


def fingerprint(model: mujoco.MjModel) -> tuple[Any, ...]:
    """Make what changes with every number that a bed, its surfaces or their doubts depend on, in microseconds."""
    geoms = (model.geom_type, model.geom_size, model.geom_pos, model.geom_quat, model.geom_contype)
    more = (model.geom_conaffinity, model.geom_dataid, model.body_plugin, model.opt.gravity)
    sums = float(model.mesh_vert.sum()), float(model.numeric_data.sum())
    return *(array.tobytes() for array in (*geoms, *more)), *sums


def _numbers(model: mujoco.MjModel, body: int) -> tuple[float, float]:
    """A length that changes with each number of the geoms that bound a body, and the size of what it is summed from."""
    parts: list[Any] = []
    for geom in bounding_geoms(model, body, "all"):
        kind, size = int(model.geom_type[geom]), model.geom_size[geom]
        parts += [size, model.geom_pos[geom], size.max() * np.abs(model.geom_quat[geom]), [size.max() * kind]]
        if kind == int(mujoco.mjtGeom.mjGEOM_MESH):
            mesh = int(model.geom_dataid[geom])
            start = model.mesh_vertadr[mesh]
            parts.append(np.abs(model.mesh_vert[start : start + model.mesh_vertnum[mesh]]).mean(axis=0))
    numbers = np.concatenate([[1e-9], *parts]).astype(float)
    weighted = numbers * (1.0 + np.sqrt(2.0) * np.arange(len(numbers)) % 1.0)
    return float(weighted.sum()), float(np.abs(weighted).sum())
