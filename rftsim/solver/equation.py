"""The equation of one time step, M (v+ - v) = h (tau + J' f(v+) + Q(v+)), as a table that compiled functions share.

One equation is that of an island: the trees of bodies that constraints join, of which some are in the sand. The table
at an address p holds counts and the addresses of arrays. What works on the equation takes p alone: it can so be
compiled and called apart. Each array is declared below by what gives it from p: its shape, in numbers and in counts of
bodies in the sand (nbody), degrees of freedom of the island (ndof) and rows of constraints (nrow), and what it holds.
"""

from typing import Final, NamedTuple

import numpy as np

from rftsim.law import step_frame
from rftsim.law.exports import AHEAD
from rftsim.law.layout import WRENCH
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, int64s, matrix
from rftsim.machine.table import Table
from rftsim.solver.state import KEPT_NUMBERS, kept_at

TABLE_HEAD: Final = np.dtype([(name, "i8") for name in ("nbody", "ndof", "nrow", "sand", "work")])
"""The head of a table: the counts, of which that of degrees of freedom is a multiple of LANES, and some of these stand
for none: they rest, of mass one; then addresses, of the packed sand, and of the counters of WORK."""
WORK: Final = np.dtype([("evaluations", "f8"), ("derivatives", "f8"), ("unsolved", "f8")])
"""The cost of solutions, counted up: evaluations of every body's force, of its derivative, and equations unsolved."""
NUMBERS: Final = np.dtype(
    [
        (name, "f8")
        for name in (
            *("timestep", "h", "started", "dragged", "is_whole", "tolerance", "iterations", "budget"),
            *("scale", "v_c", "solved", "drift", "parts", "is_linearised", "is_factored", "is_direct", "is_stiff"),
        )
    ]
)
"""MuJoCo's time step and that of the equation [s]; whether a step was made before, the integrator takes drag
implicitly, and the step may be split yet; tolerance and most iterations; evaluations' worth that may have been spent by
the end of this solution; size of the impulses but the sand's and the rows'; speed below which a triangle's stress falls
to zero [m/s]; whether the equation was solved; length of the last part of a split step [s]; parts that are needed;
whether `linear` is that of the derivatives as they are, whether `linear_factors` are its factors with the rows that act
as noted, and for v+ - v itself instead of what rows see of it; whether `stiff_mass` has the stiffness of these."""
SCORES: Final = np.dtype([("missing", "f8"), ("scale", "f8"), ("error", "f8")])
"""Scores of a tried velocity: sizes of the missing impulse and of all; speeds' error over what is allowed, unstiff."""
_OF_PROGRESS: Final = ("is_stale", "shortened", "rested", "eased", "iteration", "loosened")
PROGRESS: Final = np.dtype([(name, "f8") for name in (*_OF_PROGRESS, "share", "contraction", "enough")])
"""State of a solution under way: whether derivatives that misled should be taken anew; how often the direction was
shortened; whether a body's rest was tried, and the equation eased; iterations; factor on the tolerance; share of the
direction that is tried; of the missing impulse, what a step leaves; of all, up to what secants are followed next."""


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

_T: Final = Table(TABLE_HEAD, ("nbody", "ndof", "nrow"))
head = _T.head
"""Record TABLE_HEAD of the table at p."""
work = _T.outer(WORK, "work")
"""Record WORK, that counts for the table at p."""
numbers = _T.record(NUMBERS)
"""Record NUMBERS of the table at p."""

# Of the bodies in the sand.
path = _T.vectors("ndof", "nbody", view=int64s)
"""The degrees of freedom that move a body, rising, int64, of which `path_length` count."""
path_length = _T.vector("nbody", view=int64s)
"""Number of them, int64, (nbody,)."""
_motions = _T.vectors(WRENCH, "nbody", "ndof")
rotation, _ = _T.each("nbody", 9)
"""Body to world, row-major, (9,)."""
frame, frames = _T.each("nbody", step_frame.STEP_FRAME_NUMBERS)
"""Numbers that fix a body's depths, see `step_frame.STEP_FRAME`; moved in the parts of a split step."""
_, first_frames = _T.each("nbody", step_frame.STEP_FRAME_NUMBERS)
"""The same at the start of the step, of all bodies."""
length = _T.vector("nbody")
"""Length that makes a velocity of an angular one [m], (nbody,)."""
surface = _T.vector("nbody", view=int64s)
"""Address of each packed surface, int64, (nbody,)."""
_kept = _T.vectors(KEPT_NUMBERS, "nbody")
is_fresh = _T.vector("nbody")
"""Whether a body's derivative was taken at the present point, (nbody,)."""
strain, _ = _T.each("nbody", WRENCH)
"""What holds a body at rest, as a twist that the law feels beside the motion, (6,)."""
is_seen = _T.vector("nbody")
"""Whether a body's force was evaluated since the equation was begun, as it is now, (nbody,)."""
seen_twist, _ = _T.each("nbody", WRENCH)
"""The twist that the law last felt in that, (6,)."""
seen_answer, _ = _T.each("nbody", AHEAD)
"""The sand's answer to it, (AHEAD,)."""
is_hard = _T.vector("nbody")
"""Scratch: whether secants are followed of a body, whose derivative misled, (nbody,)."""
misfit = _T.vector("nbody")
"""Change of a body's force that its derivative did not foresee [N], (nbody,)."""

# Constraint rows, of which one at an acceleration a gives the force -D (J a - aref), limited by kind.
row_path = _T.vectors("ndof", "nrow", view=int64s)
"""The degrees of freedom of a row, rising, int64, of which `row_length` count; all rows of a cone have the same."""
row_length = _T.vector("nrow", view=int64s)
"""Number of them, int64, (nrow,)."""
row_jacobian = _T.vectors("ndof", "nrow")
"""J of a row by these."""
row_stiffness = _T.vector("nrow")
"""D, (nrow,); zero where a row's force is given."""
row_reference = _T.vector("nrow")
"""aref at the part of the step at hand, (nrow,)."""
first_stiffness = _T.vector("nrow")
"""D as MuJoCo has it, (nrow,)."""
first_reference = _T.vector("nrow")
"""aref at the start of the step, (nrow,)."""
row_kind = _T.vector("nrow", view=int64s)
"""One of KIND, int64, (nrow,)."""
row_bound = _T.vector("nrow")
"""Largest force of a friction row; of a cone its mu, of its tangents their friction, (nrow,)."""
row_damping = _T.vector("nrow")
"""Derivative of -aref by the row's velocity [1/s], (nrow,)."""
row_spring = _T.vector("nrow")
"""Derivative of -aref by the row's position [1/s^2], (nrow,)."""
row_zone = _T.vector("nrow", view=int64s)
"""Scratch: whether a row acts, see `constraint_rows`, int64, (nrow,)."""
row_error = _T.vector("nrow")
"""J a - aref at the last solution of the linearised equation, (nrow,)."""
row_force = _T.vector("nrow")
"""Scratch: the rows' forces, (nrow,)."""
row_moved = _T.vector("nrow")
"""Scratch: J of a direction, (nrow,)."""
row_tried = _T.vector("nrow")
"""Scratch: J a - aref on the way along a direction, (nrow,)."""

# The equation. Its matrices are of the pattern that `pattern` makes.
parent = _T.vector("ndof", view=int64s)
"""The last tile before one that is coupled to it, or -1, int64, of which one for each LANES rows count."""
tiles = _T.vectors("ndof", "ndof", view=int64s)
"""The first columns of the tiles that the k-th row of them has, rising, int64, of which `tile_count` count."""
tile_count = _T.vector("ndof", view=int64s)
"""Number of them, int64."""
before = _T.vector("ndof", view=int64s)
"""Number of those before the diagonal, int64."""
between = _T.vector("ndof")
"""Scratch: what the first factor's inverse makes of an impulse, (ndof,)."""
mass = _T.vector("ndof", "ndof")
"""M_h: the mass matrix with what the integrator takes implicitly, (ndof^2,)."""
mass_factors = _T.vector("ndof", "ndof")
"""Factors of `mass`, (ndof^2,)."""
plain_factors = _T.vector("ndof", "ndof")
"""Factors of `plain_mass` where there are rows and drag, (ndof^2,)."""
lightness = _T.vector("ndof")
"""About the diagonal of M^-1, (ndof,)."""
start = _T.vector("ndof")
"""v, the generalised velocity that the step starts from, (ndof,)."""
force = _T.vector("ndof")
"""tau, the smooth generalised forces but the sand's, (ndof,)."""
driven = _T.vector("ndof")
"""The velocity change by that alone, (ndof,)."""

# Its solution.
progress = _T.record(PROGRESS)
"""Record PROGRESS of the solution."""
secant, _ = _T.each("nbody", 6, 6)
"""Derivative of a body's wrench by its twist that does not overshoot, (6, 6)."""
pace = _T.vector("nbody")
"""Scratch: `motion.pace_of` the twist where a body's secant is from, zero where there is none, (nbody,)."""
slope, _ = _T.each("nbody", 6, 6)
"""Scratch: derivative of the wrench that a body's secant tells, or that secant at another pace, (6, 6)."""
velocity_of = _T.vectors("ndof", _POINTS)
"""Generalised velocity of a point, (ndof,)."""
residual_of = _T.vectors("ndof", _POINTS)
"""The impulse that is missing there, (ndof,)."""
errors_of = _T.vectors("nrow", _POINTS)
"""J a - aref of the rows there, (nrow,)."""
scores = _T.records(SCORES, _POINTS)
"""Record SCORES of point k."""
_answers_of = _T.vectors(AHEAD, _POINTS, "nbody")
end = _T.vector("ndof")
"""Generalised velocity at the end of the step, (ndof,)."""
linear = _T.vector("ndof", "ndof")
"""Scratch: M - h J' G J, G the sand's derivatives, (ndof^2,)."""
linear_factors = _T.vector("ndof", "ndof")
"""Scratch: factors of the same with the rows' stiffness, (ndof^2,)."""
twists = _T.vector(WRENCH, "ndof")
"""Scratch: -h times the twists of a body by the degrees of freedom of its path, row by row of a width, (6 ndof,)."""
wrenches = _T.vector(WRENCH, "ndof")
"""Scratch: the wrenches that follow from these, likewise, (6 ndof,)."""
power = _T.vector("ndof")
"""Scratch: their power on one degree of freedom of the path, (ndof,)."""
stiff_mass = _T.vector("ndof", "ndof")
"""Scratch: M with the rows' stiffness, (ndof^2,)."""
change = _T.vector("ndof")
"""Scratch: a velocity change v+ - v, or an impulse, (ndof,)."""
seen = _T.vector("ndof")
"""Scratch: the velocity change that MuJoCo's solver of the constraints sees, (ndof,)."""
slowed = _T.vector("ndof")
"""Scratch: the drag on a velocity change, (ndof,)."""
solved = _T.vector("ndof")
"""Scratch: an impulse over the mass: after `attempt` the error of the velocity, (ndof,)."""
sand_force = _T.vector("ndof")
"""Scratch: the sand's generalised force, (ndof,)."""
direction = _T.vector("ndof")
"""Scratch: the direction of a step of the linearised equation, as the rows see it, (ndof,)."""
taken = _T.vector("ndof")
"""Scratch: the velocity change by that, (ndof,)."""
late_share = _T.vector("ndof")
"""Scratch: about the diagonal of M^-1 M_h, or of its inverse, (ndof,)."""
missing = _T.vector("ndof")
"""Scratch: the impulse missing in the linearised equation, (ndof,)."""
fixed = _T.vector("ndof")
"""Scratch: the share of it that does not come from the rows, (ndof,)."""
search = _T.vector("ndof")
"""Scratch: the direction of a step of the solution, (ndof,)."""
last = _T.vector("ndof")
"""Scratch: the last velocity from which a secant was followed, (ndof,)."""
last_step = _T.vector("ndof")
"""Scratch: the step to where it led, (ndof,)."""
there = _T.vector("ndof")
"""Scratch: a velocity that is tried, or a change of one, (ndof,)."""
others = _T.vector("ndof")
"""Scratch: a generalised force of the sand, (ndof,)."""
mean = _T.vector("ndof")
"""Scratch: the mean velocity of a step, (ndof,)."""
answered = _T.vector("ndof")
"""Scratch: the velocity change by the rows' impulse, negative, (ndof,)."""
difference = _T.vector("ndof")
"""Scratch: the impulse by which the force at the mean velocity differs, (ndof,)."""
filtered = _T.vector("ndof")
"""Scratch: the velocity change by that impulse, (ndof,)."""

# The step that the equation is part of, as MuJoCo has it.
plain_mass = _T.vector("ndof", "ndof")
"""M, (ndof^2,)."""
drag = _T.vector("ndof", "ndof")
"""(M_h - M) / h, (ndof^2,)."""
velocity = _T.vector("ndof")
"""qvel, (ndof,)."""
smooth_force = _T.vector("ndof")
"""All smooth generalised forces but the sand's, (ndof,)."""
lacking = _T.vector("ndof")
"""The velocity that `velocity` lacks to the true one: after the last step, and in the end after this one, (ndof,)."""
out = _T.vector("ndof")
"""The sand's generalised force over the step, (ndof,)."""
after = _T.vector("ndof")
"""MuJoCo's velocity after the step, (ndof,)."""
wrench, all_wrenches = _T.each("nbody", 6)
"""Mean wrench on a body over the step, (6,)."""
momentum = _T.vector("ndof")
"""Scratch: M v, or M^-1 of a force, (ndof,)."""
grown = _T.vector("ndof")
"""Scratch: the impulse by which the force at the later depths differs, (ndof,)."""
late = _T.vector("ndof")
"""Scratch: the velocity change by that impulse, (ndof,)."""
stopped = _T.vector("ndof")
"""Scratch: the velocity change of the step, (ndof,)."""
pressed = _T.vector("ndof")
"""Scratch: the acceleration by the sand's force at the later depths, (ndof,)."""
unforced = _T.vector("ndof")
"""Scratch: the impulse missing without the sand, (ndof,)."""
mean_velocity = _T.vector("ndof")
"""Scratch: the mean velocity over the parts of a split step, (ndof,)."""
moved = _T.vector("ndof")
"""Scratch: the generalised displacement since the start of a split step, (ndof,)."""
kicked = _T.vector("ndof")
"""Scratch: the velocity change since the start of a split step, (ndof,)."""
touched = _T.vector("ndof")
"""Scratch: mean generalised force of the contacts over the parts of a split step, (ndof,)."""
true_end = _T.vector("ndof")
"""Scratch: the true velocity at the end of a split step, (ndof,)."""

TABLE: Final = _T.size
"""Numbers of a table, int64."""
_lay_out_arrays, _place_arrays = _T.layout(), _T.place()


@inline
def kept_address(p, b):
    """Address of a body's record KEPT."""
    return _kept(p, b).ctypes.data


@inline
def kept(p, b):
    """Record KEPT of a body: from the last step, and in the end for the next one."""
    return kept_at(kept_address(p, b))


@inline
def derivative(p, b):
    """Derivative of a body's wrench by its twist, (6, 6): that of its KEPT."""
    return matrix(kept(p, b).derivative.ctypes.data, WRENCH, WRENCH)


@inline
def motion(p, b, k):
    """Twist of a body about its origin by the k-th degree of freedom of its path, velocity first, world frame, (6,)."""
    return _motions(p, head(p).ndof * b + k)


@inline
def wrench_of(p, k, b, later):
    """A body's wrench at point k: at the present depths (0) or those after the step (1), (6,)."""
    return doubles(answer_of(p, k, b).ctypes.data + 8 * WRENCH * later, WRENCH)


@inline
def answer_of(p, k, b):
    """The sand's answer to a body's motion at point k: its wrenches and its depth, see `exports.ahead`, (AHEAD,)."""
    return _answers_of(p, head(p).nbody * k + b)


@inline
def answers_of(p, k):
    """All bodies' answers at point k, (AHEAD nbody,)."""
    return doubles(answer_of(p, k, 0).ctypes.data, AHEAD * head(p).nbody)


@exact
def lay_out(p, nbody, ndof, nrow):
    """Fill the table at p for so many bodies, degrees of freedom and rows; the bytes that its arrays take."""
    counts = head(p)
    counts.nbody, counts.ndof, counts.nrow = nbody, ndof, nrow
    return _lay_out_arrays(p)


@exact
def place(p, address):
    """Place the arrays of a table that was laid out at an address.

    The outer addresses of sand and work are for the caller to fill.
    """
    _place_arrays(p, address)
