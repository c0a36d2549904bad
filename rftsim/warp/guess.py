"""Guesses at the twist that a step ends in, about which the sand's wrench is linearised.

At rest the force is held by a strain: what is evaluated is the law at V + S, S the way that the body went over the time
step, at most LIMIT v_c. So v_c may be large against rounding, and what rests does not creep.
"""

from typing import Final

import warp as wp

from rftsim.warp.frames import State
from rftsim.warp.linear import Model, rotated, twist_of
from rftsim.warp.surfaces import Paths, Surfaces
from rftsim.warp.translate import LEAST

V_C: Final = wp.constant(1e-4)
"""Speed v_c [m/s] below which a triangle's stress falls to zero."""
LIMIT: Final = wp.constant(10.0)
"""The largest strain over v_c; the sand then bears 0.995 of its strength at rest."""
SHORT: Final = wp.constant(0.9)
"""The share of a motion's power against the sand after which a guess at the end of the step goes no further."""
STIFFER: Final = wp.constant(1.25)
"""The derivative near rest over the secant: with less a plate on a slope rocked for ever, with 2 none broke away."""
_TINY: Final = wp.constant(LEAST)


@wp.func
def size_of(twist: wp.spatial_vector, length: float):
    """Root of the squares of a velocity and of an angular velocity times a length [m/s]."""
    v, w = wp.spatial_top(twist), wp.spatial_bottom(twist)
    return wp.sqrt(wp.dot(v, v) + length * length * wp.dot(w, w))


@wp.func
def secant_for(change: float, speed: float):
    """How far the derivative is to be the secant, after a change of a body's speed, and where it is nearly at rest.

    The force of a law that knows only the direction of motion jumps at rest. A tangent far from there is exact, and
    leads past it where the body stops; the secant leads to rest, and is wrong by the relative change of speed.
    """
    resting = wp.clamp(2.0 - 0.5 * speed / (LIMIT * V_C), 0.0, 1.0)
    return wp.max(wp.min(change / wp.max(speed, _TINY), 1.0), STIFFER * resting)


@wp.func
def keep_past(model: Model, state: State, world: int, body: int, time: float):
    """Keep what the last step left, so that a step that is begun again, as `mujoco_warp.forward` does, is the same."""
    if model.clock[world, body] != time:
        model.clock[world, body] = time
        model.start_before[world, body] = model.start[world, body]
        model.strain_before[world, body] = model.strain[world, body]
        model.near_before[world, body] = state.near[world, body]


@wp.func
def before_rest(wrench: wp.spatial_vector, twist: wp.spatial_vector, change: wp.spatial_vector):
    """The share of a change after which a motion against a wrench is all but stopped; 1 where it does not stop.

    A motion that the sand would drive is none: it is the next guess's to stay short of that.
    """
    power, gain = wp.dot(wrench, twist), wp.dot(wrench, change)
    share = float(1.0)
    if power < 0.0 and power + gain > (1.0 - SHORT) * power:
        share = wp.min(-SHORT * power / gain, 1.0)
    return share


@wp.kernel(enable_backward=False)
def begin(
    surfaces: Surfaces,
    paths: Paths,
    time: wp.array(dtype=float),
    qvel: wp.array2d(dtype=float),
    xmat: wp.array2d(dtype=wp.mat33),
    is_implicit: bool,
    model: Model,
    state: State,
):
    """Begin a step at its own velocity, over (nworld, nbody); of the implicit force, with what the last step left."""
    world, body = wp.tid()
    twist, length = twist_of(paths, model, qvel, world, body), surfaces.gyration[body]
    keep_past(model, state, world, body, time[world])
    change = size_of(twist - model.start_before[world, body], length)
    model.start[world, body] = twist
    state.twist[world, body] = twist
    if is_implicit:
        turn = xmat[world, surfaces.body[body]]
        back, strain = wp.transpose(turn), model.strain_before[world, body]
        v = wp.spatial_top(strain) + back * wp.spatial_top(twist)
        w = wp.spatial_bottom(strain) + back * wp.spatial_bottom(twist)
        speed = size_of(wp.spatial_vector(v, w), length)
        share = wp.min(1.0, LIMIT * V_C / wp.max(speed, _TINY))
        if model.near_before[world, body] == 0:
            share = 0.0
        model.strain[world, body] = wp.spatial_vector(share * v, share * w)
        left = 1.0 - share
        model.twist[world, body] = wp.spatial_vector(turn * (left * v), turn * (left * w))
        state.twist[world, body] = wp.spatial_vector(turn * v, turn * w)
        model.secant[world, body] = secant_for(change, speed)


@wp.kernel(enable_backward=False)
def go_on(
    surfaces: Surfaces,
    paths: Paths,
    velocity: wp.array2d(dtype=float),
    xmat: wp.array2d(dtype=wp.mat33),
    model: Model,
    state: State,
):
    """Take the model's twist to that at a velocity, over (nworld, nbody)."""
    world, body = wp.tid()
    twist = twist_of(paths, model, velocity, world, body)
    turn, held, length = xmat[world, surfaces.body[body]], model.strain[world, body], surfaces.gyration[body]
    strain = rotated(turn, held)
    last = state.twist[world, body]
    whole = twist + strain - last
    change = before_rest(model.wrench[world, body], last, whole) * whole
    model.twist[world, body] = last + change - strain
    state.twist[world, body] = last + change
    model.secant[world, body] = secant_for(size_of(change, length), size_of(last + change, length))
