"""The equation of a whole step as MuJoCo sees it, and the force that makes its step end at a given velocity."""

from rftsim.machine.compiling import exact
from rftsim.solver import constraint_rows, equation, linear_algebra, linearised, matrices, residual


@exact
def prepare(p, h):
    """Set the equation's mass and its factors, and its step, for a time h."""
    numbers, mass, factors = equation.numbers(p), equation.mass(p), equation.mass_factors(p)
    numbers.h, numbers.is_linearised, numbers.is_stiff = h, 0.0, 0.0
    matrices.copy(p, equation.plain_mass(p), mass)
    if numbers.dragged > 0.0:
        matrices.add(p, equation.drag(p), h, mass)
    matrices.copy(p, mass, factors)
    matrices.factor(p, factors)


@exact
def reset(p):
    """Set the equation to the whole step from MuJoCo's own velocity."""
    linear_algebra.copy(equation.velocity(p), equation.start(p))
    linear_algebra.copy(equation.smooth_force(p), equation.force(p))
    linear_algebra.copy(equation.first_stiffness(p), equation.row_stiffness(p))
    linear_algebra.copy(equation.first_reference(p), equation.row_reference(p))


@exact
def force_to(p, velocity, out):
    """Fill out with the sand's force that makes MuJoCo's step end at a velocity; the equation is that of the step."""
    h = equation.numbers(p).timestep
    linear_algebra.copy(equation.velocity(p), equation.start(p))
    unforced, errors = equation.unforced(p), equation.row_error(p)
    linear_algebra.clear(out)
    constraint_rows.errors_at(p, velocity, errors)
    residual.fill(p, velocity, errors, out, unforced)
    for k in range(out.size):
        out[k] = unforced[k] / h


@exact
def answer_to(p, q, out):
    """Fill out with the velocity in which MuJoCo's step ends under a generalised force of the sand."""
    reset(p)
    prepare(p, equation.numbers(p).timestep)
    v, missing = equation.velocity(p), equation.unforced(p)
    errors = equation.row_tried(p)
    constraint_rows.errors_at_start(p, errors)
    residual.fill(p, v, errors, q, missing)
    linearised.solution(p, v, errors, missing, linearised.NONE, out)
