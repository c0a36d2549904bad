"""Surfaces reduced to the fewest elements that a model needs, as far as its joints let its bodies go."""

import functools

import mujoco

from rftsim.law import layout
from rftsim.model.felt import Felt
from rftsim.model.reach import sampled_reach
from rftsim.reduction.memory import Memory, user_folder
from rftsim.reduction.reduce import Economy
from rftsim.surface.triangles import Array


def economise(model: mujoco.MjModel, felt: Felt, bed: Array, reduction: float) -> dict[str, Economy]:
    """Replace surfaces by the fewest elements that keep an error, and say so in the reasons.

    Args:
        model: Compiled.
        felt: The bodies that feel the sand; changed in place.
        bed: Packed sand.
        reduction: Largest error of a body's wrench, over the largest wrench.

    Returns:
        The numbers of each surface before and after, by body name.
    """
    names, economies = list(felt.surfaces), {}
    bodies = [
        (surface, functools.cache(functools.partial(sampled_reach, model, model.body(name).id, surface)))
        for name, surface in felt.surfaces.items()
    ]
    for name, found in zip(names, Memory(user_folder()).all_reduced(bodies, _evaluated(bed), reduction), strict=True):
        felt.surfaces[name], economies[name] = found
        felt.reasons[name] += f"; {_said(economies[name], reduction)}"
    return economies


def _evaluated(bed: Array) -> Array:
    """Packed sand as reductions are remembered by it, which do not ask how exactly the implicit force is solved for."""
    same = bed.copy()
    record = layout.record(same, layout.BED)
    record.tolerance, record.iterations = layout.TOLERANCE, layout.ITERATIONS
    return same


def _said(found: Economy, reduction: float) -> str:
    if found.elements < found.triangles:
        return f"{found.elements} elements keep its wrench within {100 * found.error:.2g} %"
    if found.triangles <= layout.BLOCK:
        return f"one block of {layout.BLOCK} already, the least that the implicit force's derivative takes"
    return f"no fewer elements found that keep its wrench within {100 * reduction:g} %"
