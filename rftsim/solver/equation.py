"""The equation of one time step, M (v+ - v) = h (tau + J' f(v+) + Q(v+)), as a table that compiled functions share.

The table holds three counts and the addresses of arrays. What works on the equation takes the table's address alone:
it can so be compiled and called apart, see `native`.
"""

from typing import Final, NamedTuple

from numba import njit

from rftsim.law.exports_ahead import FRAME
from rftsim.machine.memory import doubles, int64s, matrix


class Entries(NamedTuple):
    """Where the table holds what."""

    nbody: int
    """Bodies in the sand."""
    nv: int
    """Degrees of freedom."""
    nrow: int
    """Rows of constraints."""

    # Of the bodies in the sand.
    jacobian: int
    """Twist of each body about its origin, velocity first, world frame, by the generalised velocity, (nbody, 6, nv)."""
    rotation: int
    """Body to world, row-major, (nbody, 9)."""
    frames: int
    """What fixes the depths, see `native_ahead`, (nbody, FRAME)."""
    length: int
    """Length that makes a velocity of an angular one [m], (nbody,)."""
    surface: int
    """Address of each packed surface, int64, (nbody,)."""
    sand: int
    """Packed sand."""

    # Constraint rows, of which one at an acceleration a gives the force -D (J a - aref), limited by kind.
    row_jacobian: int
    """J, (nrow, nv)."""
    row_drag: int
    """J M^-1 of the drag, (nrow, nv)."""
    row_acceleration: int
    """J M^-1 M_h, which turns (v+ - v) / h into the acceleration that MuJoCo's solver sees, (nrow, nv)."""
    row_stiffness: int
    """D, (nrow,)."""
    row_reference: int
    """aref, (nrow,)."""
    row_kind: int
    """One of KIND, int64, (nrow,)."""
    row_bound: int
    """Largest force of a friction row; of a cone its mu, of its tangents their friction, (nrow,)."""
    row_damping: int
    """Derivative of -aref by the row's velocity, (nrow,)."""
    row_spring: int
    """Derivative of -aref by the row's position, (nrow,)."""
    row_scratch: int
    """(4, nrow)."""

    # The equation.
    mass: int
    """M_h: the mass matrix with what the integrator takes implicitly, (nv, nv)."""
    mass_factors: int
    mass_order: int
    start: int
    """v, (nv,)."""
    force: int
    """tau, (nv,)."""
    step: int
    """h [s], size of the impulse h tau, and the speed v_c [m/s] below which a triangle's stress falls to zero, (3,)."""

    # Its solution.
    last: int
    """A velocity near the solution, (nv,)."""
    foreseen: int
    """The sand's force foreseen there, (nv,)."""
    derivative: int
    """Derivative of each body's wrench by its twist, (nbody, 6, 6)."""
    completed: int
    """One that does not overshoot, (nbody, 6, 6)."""
    points: int
    """The tried velocities."""
    end: int
    """Velocity at the end, (nv,)."""
    flags: int
    """Whether the derivative is known; whether the equation was solved."""
    counts: int
    """Evaluations, derivatives, unsolved equations; counted up."""
    matrices: int
    """Scratch, (2, nv, nv)."""
    order: int
    """Scratch, int64, (nv,)."""
    vectors: int
    """Scratch, (9, nv)."""

    # The step that the equation is part of, as MuJoCo has it.
    plain_mass: int
    """M, (nv, nv)."""
    drag: int
    """(M_h - M) / h, (nv, nv)."""
    velocity: int
    """qvel, (nv,)."""
    smooth_force: int
    """All smooth forces but the sand's, (nv,)."""
    timestep: int
    """[s], (1,)."""
    first_stiffness: int
    first_reference: int
    first_frames: int
    old: int
    """State after the last step, see `state`."""
    new: int
    """State after this one."""
    before: int
    """Copy of the old state, to forget parts of."""
    wrench: int
    """Mean wrench on each body over the step, (nbody, 6)."""
    out: int
    """The sand's generalised force, (nv,)."""
    step_vectors: int
    """Scratch, (6, nv)."""


AT: Final = Entries(*range(len(Entries._fields)))
"""Numba would compile what takes an entry anew for each constant; of a tuple's fields it takes the type alone."""
ENTRIES: Final = len(AT)


class Vectors(NamedTuple):
    """The scratch vectors, by what they are used for; two uses share one where they never meet."""

    change: int
    solved: int
    sand: int
    direction: int
    missing: int
    fixed: int
    mean: int
    difference: int
    filtered: int


class Rows(NamedTuple):
    """The scratch vectors of the constraint rows."""

    x: int
    force: int
    moved: int
    tried: int


class Kept(NamedTuple):
    """The scratch vectors of the stepping, which the solver leaves alone."""

    one: int
    two: int
    three: int
    four: int
    five: int
    six: int


class Points(NamedTuple):
    """The tried velocities."""

    best: int
    now: int
    new: int
    spare: int


class Parts(NamedTuple):
    """Parts of a tried velocity: itself, and the impulse that it misses, (nv,) each.

    Behind them lie each body's wrench at the present depths and at those after the step, (nbody, 12); then the sizes of
    the residual and of all impulses, and the error over what is allowed.
    """

    velocity: int
    residual: int


class Marks(NamedTuple):
    """Kinds of constraint rows."""

    equality: int
    limit: int
    friction: int
    contact: int
    cone: int
    tangent: int


VECTOR: Final = Vectors(*range(9))
POINT: Final = Points(*range(4))
PART: Final = Parts(*range(2))
KIND: Final = Marks(*range(6))
ROW: Final = Rows(*range(4))
KEEP: Final = Kept(*range(6))


@njit
def point_size(nbody, nv):
    """Numbers of a tried velocity."""
    return 2 * nv + 12 * nbody + 3


@njit
def _place(table, entry, at, count):
    table[entry] = at
    return at + 8 * count


@njit
def lay_out(p, at, nbody, nv, nrow, state):
    """Fill the table at p with addresses from `at` on; the address behind the last.

    What lies elsewhere (AT.sand, AT.counts, AT.old, AT.new) is for the caller to fill.
    """
    t = int64s(p, ENTRIES)
    t[AT.nbody], t[AT.nv], t[AT.nrow] = nbody, nv, nrow
    at = _place(t, AT.jacobian, at, nbody * 6 * nv)
    at = _place(t, AT.rotation, at, nbody * 9)
    at = _place(t, AT.length, at, nbody)
    at = _place(t, AT.surface, at, nbody)
    for entry in (AT.frames, AT.first_frames):
        at = _place(t, entry, at, nbody * FRAME)
    for entry in (AT.row_jacobian, AT.row_drag, AT.row_acceleration):
        at = _place(t, entry, at, nrow * nv)
    for entry in (AT.row_stiffness, AT.row_reference, AT.row_kind, AT.row_bound, AT.row_damping, AT.row_spring):
        at = _place(t, entry, at, nrow)
    for entry in (AT.first_stiffness, AT.first_reference):
        at = _place(t, entry, at, nrow)
    at = _place(t, AT.row_scratch, at, 4 * nrow)
    for entry in (AT.mass, AT.mass_factors, AT.plain_mass, AT.drag):
        at = _place(t, entry, at, nv * nv)
    at = _place(t, AT.matrices, at, 2 * nv * nv)
    for entry in (
        AT.mass_order,
        AT.order,
        AT.start,
        AT.force,
        AT.last,
        AT.foreseen,
        AT.end,
        AT.velocity,
        AT.smooth_force,
        AT.out,
    ):
        at = _place(t, entry, at, nv)
    for entry in (AT.step, AT.flags, AT.timestep):
        at = _place(t, entry, at, 3)
    for entry in (AT.derivative, AT.completed):
        at = _place(t, entry, at, 36 * nbody)
    at = _place(t, AT.points, at, 4 * point_size(nbody, nv))
    at = _place(t, AT.vectors, at, 9 * nv)
    at = _place(t, AT.step_vectors, at, 6 * nv)
    at = _place(t, AT.wrench, at, 6 * nbody)
    return _place(t, AT.before, at, state)


@njit
def number(p, entry):
    """A count, or an address."""
    return int64s(p, ENTRIES)[entry]


@njit
def of_dofs(p, entry):
    """An array (nv,)."""
    return doubles(number(p, entry), number(p, AT.nv))


@njit
def of_rows(p, entry):
    """An array (nrow,)."""
    return doubles(number(p, entry), number(p, AT.nrow))


@njit
def rows_by_dofs(p, entry):
    """An array (nrow, nv)."""
    return matrix(number(p, entry), number(p, AT.nrow), number(p, AT.nv))


@njit
def square(p, entry):
    """An array (nv, nv)."""
    return matrix(number(p, entry), number(p, AT.nv), number(p, AT.nv))


@njit
def scratch(p, k):
    """A scratch matrix (nv, nv)."""
    nv = number(p, AT.nv)
    return matrix(number(p, AT.matrices) + 8 * k * nv * nv, nv, nv)


@njit
def vector(p, k):
    """A scratch vector (nv,)."""
    nv = number(p, AT.nv)
    return doubles(number(p, AT.vectors) + 8 * k * nv, nv)


@njit
def order(p, entry):
    """The order of the rows that belongs to factors."""
    return int64s(number(p, entry), number(p, AT.nv))


@njit
def body_jacobian(p, b):
    """Of one body, (6, nv)."""
    nv = number(p, AT.nv)
    return matrix(number(p, AT.jacobian) + 8 * 6 * nv * b, 6, nv)


@njit
def body_frame(p, b):
    """Of one body, (FRAME,)."""
    return doubles(number(p, AT.frames) + 8 * FRAME * b, FRAME)


@njit
def body_rotation(p, b):
    """Of one body, (9,)."""
    return doubles(number(p, AT.rotation) + 8 * 9 * b, 9)


@njit
def body_length(p, b):
    """Of one body [m]."""
    return doubles(number(p, AT.length), number(p, AT.nbody))[b]


@njit
def body_surface(p, b):
    """The address of one body's packed surface."""
    return int64s(number(p, AT.surface), number(p, AT.nbody))[b]


@njit
def derivative(p, entry, b):
    """Of one body's wrench, (6, 6)."""
    return matrix(number(p, entry) + 8 * 36 * b, 6, 6)


@njit
def point(p, k):
    """The address of a tried velocity."""
    return number(p, AT.points) + 8 * k * point_size(number(p, AT.nbody), number(p, AT.nv))


@njit
def point_vector(p, at, part):
    """The velocity or the residual of a point, (nv,)."""
    nv = number(p, AT.nv)
    return doubles(at + 8 * part * nv, nv)


@njit
def point_wrench(p, at, b, later):
    """A body's wrench of a point: at the present depths (0) or the later ones (1), (6,)."""
    return doubles(at + 8 * (2 * number(p, AT.nv) + 12 * b + 6 * later), 6)


@njit
def point_scores(p, at):
    """Size of the residual, size of the impulses, and error of a point, (3,)."""
    nv, nbody = number(p, AT.nv), number(p, AT.nbody)
    return doubles(at + 8 * (2 * nv + 12 * nbody), 3)


@njit
def step_vector(p, k):
    """A scratch vector of the stepping, (nv,)."""
    nv = number(p, AT.nv)
    return doubles(number(p, AT.step_vectors) + 8 * k * nv, nv)
