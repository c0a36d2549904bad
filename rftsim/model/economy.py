"""Surfaces reduced to the fewest elements that a model needs, as far as its joints let its bodies go."""

import functools

import mujoco

from rftsim.law import layout
from rftsim.model.felt import Felt
from rftsim.model.reach import LEVEL, Slopes, sampled_reach
from rftsim.reduction.memory import Memory, user_folder
from rftsim.reduction.reduce import Economy
from rftsim.surface.triangles import Array


def economise(model: mujoco.MjModel, felt: Felt, bed: Array, reduction: float, slopes: Slopes) -> dict[str, Economy]:
    """Replace surfaces by the fewest elements that keep an error, and say so in the reasons.

    Args:
        model: Compiled.
        felt: The bodies that feel the sand; changed in place.
        bed: Packed sand.
        reduction: Largest error of a body's wrench, over the largest wrench; at zero they stay.
        slopes: Slopes on which it is kept: of a plane its own, and of a terrain all that it has.

    Returns:
        The numbers of each surface before and after, by body name.
    """
    if reduction == 0.0:
        return {}
    names, economies = list(felt.surfaces), {}
    bodies = [
        (surface, functools.cache(functools.partial(sampled_reach, model, model.body(name).id, surface, slopes=slopes)))
        for name, surface in felt.surfaces.items()
    ]
    for name, found in zip(
        names, Memory(user_folder()).all_reduced(bodies, _evaluated(bed, slopes), reduction), strict=True
    ):
        felt.surfaces[name], economies[name] = found
        felt.reasons[name] += f"; {_said(economies[name], reduction)}"
    return economies


def _evaluated(bed: Array, slopes: Slopes) -> Array:
    """Packed sand as reductions are remembered by it, which do not ask how exactly the implicit force is solved for.

    That of a terrain is level: the bodies are turned to its slopes.
    """
    same = bed[: layout.BED_NUMBERS].copy()
    record = layout.record(same, layout.BED)
    record.tolerance, record.iterations = layout.TOLERANCE, layout.ITERATIONS
    if slopes is not LEVEL:
        record.up, record.offset, record.relief = (0.0, 0.0, 1.0), 0.0, 0.0
    return same


def _said(found: Economy, reduction: float) -> str:
    if found.elements < found.triangles:
        return f"{found.elements} elements keep its wrench within {100 * found.error:.2g} %"
    if found.triangles <= layout.BLOCK:
        return f"one block of {layout.BLOCK} already, the least that the implicit force's derivative takes"
    return f"no fewer elements found that keep its wrench within {100 * reduction:g} %"
