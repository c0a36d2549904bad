"""The equation of one time step, M (v+ - v) = h (tau + J' f(v+) + Q(v+)), as a table that compiled functions share.

The table at an address p holds counts and the addresses of arrays. What works on the equation takes p alone: it can so
be compiled and called apart. Each array is declared below by what gives it from p: its shape, in numbers and in counts
of bodies in the sand (nbody), degrees of freedom (nv) and rows of constraints (nrow), and what it holds.
"""

from typing import Final, NamedTuple

import numpy as np

from rftsim.law import step_frame
from rftsim.law.layout import WRENCH
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, int64s
from rftsim.machine.table import Table
from rftsim.solver.state import State, state_size

TABLE_HEAD: Final = np.dtype([(name, "i8") for name in ("nbody", "nv", "nrow", "sand", "work", "old", "new", "before")])
"""The head of a table: the counts; then addresses, of the packed sand, of the counters of WORK, and of three
states: after the last step, after this one, and a copy of the former to forget parts of."""
WORK: Final = np.dtype([("evaluations", "f8"), ("derivatives", "f8"), ("unsolved", "f8")])
"""The cost of solutions, counted up: evaluations of every body's force, of its derivative, and equations unsolved."""
NUMBERS: Final = np.dtype(
    [("timestep", "f8"), ("h", "f8"), ("impulse", "f8"), ("v_c", "f8"), ("knows_derivative", "f8"), ("solved", "f8")]
)
"""MuJoCo's time step [s]; that of the equation [s]; size of the impulse h tau; speed below which a triangle's stress
falls to zero [m/s]; whether `derivative` is known; whether the equation was solved."""
SCORES: Final = np.dtype([("missing", "f8"), ("scale", "f8"), ("error", "f8")])
"""Scores of a tried velocity: size of the missing impulse, size of all impulses, and error of the bodies' speeds over
what is allowed."""
PROGRESS: Final = np.dtype(
    [
        (name, "f8")
        for name in (
            *("knows_derivative", "is_stale", "is_fresh", "by_secant", "secants_left", "shortened", "failures"),
            *("iteration", "loosened", "share"),
        )
    ]
)
"""State of a solution under way: whether there is a derivative at all, it should be taken anew, and was taken at the
present point; whether the direction comes from the completed one, and for how many more steps; how often the direction
was shortened, and failed; iterations; factor on the tolerance; share of the direction that is tried."""


class Kinds(NamedTuple):
    """The kinds of constraint rows that the equation tells apart."""

    equality: int
    limit: int
    friction: int
    contact: int
    cone: int
    tangent: int


KIND: Final = Kinds(*range(6))


class Points(NamedTuple):
    """The tried velocities of a solution."""

    best: int
    now: int
    new: int
    spare: int


POINT: Final = Points(*range(4))
_POINTS: Final = len(POINT)

_T: Final = Table(TABLE_HEAD, ("nbody", "nv", "nrow"))
head = _T.head
"""Record TABLE_HEAD of the table at p."""
work = _T.outer(WORK, "work")
"""Record WORK, that counts for the table at p."""
numbers = _T.record(NUMBERS)
"""Record NUMBERS of the table at p."""

# Of the bodies in the sand.
jacobian, _ = _T.each("nbody", 6, "nv")
"""Twist of a body about its origin, velocity first, world frame, by the generalised velocity, (6, nv)."""
rotation, _ = _T.each("nbody", 9)
"""Body to world, row-major, (9,)."""
frame, frames = _T.each("nbody", step_frame.STEP_FRAME_NUMBERS)
"""Numbers that fix a body's depths, see `step_frame.STEP_FRAME`; moved in the parts of a split step."""
_, first_frames = _T.each("nbody", step_frame.STEP_FRAME_NUMBERS)
"""The same at the start of the step, of all bodies."""
length = _T.vector("nbody")
"""Length that makes a velocity of an angular one [m], (nbody,)."""
surface = _T.vector("nbody", int64s)
"""Address of each packed surface, int64, (nbody,)."""

# Constraint rows, of which one at an acceleration a gives the force -D (J a - aref), limited by kind.
row_jacobian = _T.matrix("nrow", "nv")
"""J, (nrow, nv)."""
row_drag = _T.matrix("nrow", "nv")
"""J M^-1 of the drag, (nrow, nv)."""
row_acceleration = _T.matrix("nrow", "nv")
"""J M^-1 M_h, which turns (v+ - v) / h into the acceleration that MuJoCo's solver sees, (nrow, nv)."""
row_stiffness = _T.vector("nrow")
"""D, (nrow,); zero where a row's force is given."""
row_reference = _T.vector("nrow")
"""aref at the part of the step at hand, (nrow,)."""
first_stiffness = _T.vector("nrow")
"""D as MuJoCo has it, (nrow,)."""
first_reference = _T.vector("nrow")
"""aref at the start of the step, (nrow,)."""
row_kind = _T.vector("nrow", int64s)
"""One of KIND, int64, (nrow,)."""
row_bound = _T.vector("nrow")
"""Largest force of a friction row; of a cone its mu, of its tangents their friction, (nrow,)."""
row_damping = _T.vector("nrow")
"""Derivative of -aref by the row's velocity [1/s], (nrow,)."""
row_spring = _T.vector("nrow")
"""Derivative of -aref by the row's position [1/s^2], (nrow,)."""
row_error = _T.vector("nrow")
"""Scratch: J a - aref, (nrow,)."""
row_force = _T.vector("nrow")
"""Scratch: the rows' forces, (nrow,)."""
row_moved = _T.vector("nrow")
"""Scratch: change of J a along a direction, (nrow,)."""
row_tried = _T.vector("nrow")
"""Scratch: J a - aref on the way along a direction, (nrow,)."""

# The equation.
mass = _T.matrix("nv", "nv")
"""M_h: the mass matrix with what the integrator takes implicitly, (nv, nv)."""
mass_factors = _T.matrix("nv", "nv")
"""LU factors of `mass`, (nv, nv)."""
mass_order = _T.vector("nv", int64s)
"""Order of their rows, int64, (nv,)."""
start = _T.vector("nv")
"""v, the generalised velocity that the step starts from, (nv,)."""
force = _T.vector("nv")
"""tau, the smooth generalised forces but the sand's, (nv,)."""

# Its solution.
progress = _T.record(PROGRESS)
"""Record PROGRESS of the solution."""
last = _T.vector("nv")
"""A velocity near the solution, (nv,)."""
foreseen = _T.vector("nv")
"""The sand's generalised force foreseen there, (nv,)."""
derivative, derivatives = _T.each("nbody", 6, 6)
"""Derivative of a body's wrench by its twist, (6, 6)."""
completed, _ = _T.each("nbody", 6, 6)
"""One that does not overshoot, (6, 6)."""
velocity_of = _T.vectors("nv", _POINTS)
"""Generalised velocity of a point, (nv,)."""
residual_of = _T.vectors("nv", _POINTS)
"""The impulse that is missing there, (nv,)."""
scores = _T.records(SCORES, _POINTS)
"""Record SCORES of point k."""
_wrenches_of = _T.vectors(WRENCH, _POINTS, "nbody", 2)
end = _T.vector("nv")
"""Generalised velocity at the end of the step, (nv,)."""
linear = _T.matrix("nv", "nv")
"""Scratch: M - h J' G J, G the sand's derivatives, (nv, nv)."""
linear_factors = _T.matrix("nv", "nv")
"""Scratch: LU factors of the same with the rows' stiffness, (nv, nv)."""
linear_order = _T.vector("nv", int64s)
"""Scratch: order of their rows, int64, (nv,)."""
change = _T.vector("nv")
"""Scratch: a velocity change v+ - v, or an impulse, (nv,)."""
column = _T.vector("nv")
"""Scratch: a row of a derivative by the generalised velocity, (nv,)."""
solved = _T.vector("nv")
"""Scratch: an impulse over the mass: after `attempt` the error of the velocity, (nv,)."""
sand_force = _T.vector("nv")
"""Scratch: the sand's generalised force, (nv,)."""
direction = _T.vector("nv")
"""Scratch: the direction of a step of the linearised equation, (nv,)."""
missing = _T.vector("nv")
"""Scratch: the impulse missing in the linearised equation, (nv,)."""
fixed = _T.vector("nv")
"""Scratch: the share of it that does not come from the rows, (nv,)."""
search = _T.vector("nv")
"""Scratch: the direction of a step of the solution, (nv,)."""
there = _T.vector("nv")
"""Scratch: a velocity beside a body's rest, (nv,)."""
others = _T.vector("nv")
"""Scratch: the sand's generalised force on all bodies but one, (nv,)."""
mean = _T.vector("nv")
"""Scratch: the mean velocity of a step, (nv,)."""
difference = _T.vector("nv")
"""Scratch: the impulse by which the force at the mean velocity differs, (nv,)."""
filtered = _T.vector("nv")
"""Scratch: the velocity change by that impulse, (nv,)."""

# The step that the equation is part of, as MuJoCo has it.
plain_mass = _T.matrix("nv", "nv")
"""M, (nv, nv)."""
drag = _T.matrix("nv", "nv")
"""(M_h - M) / h, (nv, nv)."""
velocity = _T.vector("nv")
"""qvel, (nv,)."""
smooth_force = _T.vector("nv")
"""All smooth generalised forces but the sand's, (nv,)."""
out = _T.vector("nv")
"""The sand's generalised force over the step, (nv,)."""
wrench, all_wrenches = _T.each("nbody", 6)
"""Mean wrench on a body over the step, (6,)."""
momentum = _T.vector("nv")
"""Scratch: M v, or M^-1 of a force, (nv,)."""
grown = _T.vector("nv")
"""Scratch: the impulse by which the force at the later depths differs, (nv,)."""
late = _T.vector("nv")
"""Scratch: the velocity change by that impulse, (nv,)."""
stopped = _T.vector("nv")
"""Scratch: the velocity change of the step, (nv,)."""
unforced = _T.vector("nv")
"""Scratch: the impulse missing without the sand, (nv,)."""
nothing = _T.vector("nv")
"""Scratch: zeros, (nv,)."""
later_force = _T.vector("nv")
"""Scratch: the force foreseen for the next step, (nv,)."""
mean_velocity = _T.vector("nv")
"""Scratch: the mean velocity over the parts of a split step, (nv,)."""
moved = _T.vector("nv")
"""Scratch: the generalised displacement since the start of a split step, (nv,)."""
kicked = _T.vector("nv")
"""Scratch: the velocity change since the start of a split step, (nv,)."""
touched = _T.vector("nv")
"""Scratch: mean generalised force of the contacts over the parts of a split step, (nv,)."""
true_end = _T.vector("nv")
"""Scratch: the true velocity at the end of a split step, (nv,)."""

TABLE: Final = _T.size
"""Numbers of a table, int64."""
_lay_out_arrays, _place_arrays = _T.layout(), _T.place()


@inline
def wrench_of(p, k, b, later):
    """A body's wrench at point k: at the present depths (0) or those after the step (1), (6,)."""
    return _wrenches_of(p, 2 * (head(p).nbody * k + b) + later)


@inline
def wrenches_of(p, k):
    """All bodies' wrenches at point k, at both depths, (12 nbody,)."""
    return doubles(wrench_of(p, k, 0, 0).ctypes.data, 2 * WRENCH * head(p).nbody)


@inline
def state(p, address):
    """The state at an address, of as many bodies and degrees of freedom as the equation has."""
    return State(address, head(p).nbody, head(p).nv)


@exact
def lay_out(p, nbody, nv, nrow):
    """Fill the table at p for so many bodies, degrees of freedom and rows; the bytes that its arrays take."""
    counts = head(p)
    counts.nbody, counts.nv, counts.nrow = nbody, nv, nrow
    counts.before = _lay_out_arrays(p)
    return counts.before + 8 * state_size(nbody, nv)


@exact
def place(p, address):
    """Place the arrays of a table that was laid out at an address.

    The outer addresses of sand, work, old and new state are for the caller to fill.
    """
    head(p).before += address
    _place_arrays(p, address)
