"""The equation of a whole step as MuJoCo sees it, and the force that makes its step end at a given velocity."""

from rftsim.machine.compiling import exact
from rftsim.solver import equation, linear_algebra, linearised, residual


@exact
def prepare(p, h):
    """Set the equation's mass and its factors, its rows and its step for a time h."""
    drag, plain, mass = equation.drag(p), equation.plain_mass(p), equation.mass(p)
    for i in range(mass.shape[0]):
        for k in range(mass.shape[0]):
            mass[i, k] = plain[i, k] + h * drag[i, k]
    linear_algebra.factor_of(mass, equation.mass_factors(p), equation.mass_order(p))
    j, dragged, seen = equation.row_jacobian(p), equation.row_drag(p), equation.row_acceleration(p)
    for i in range(j.shape[0]):
        for k in range(j.shape[1]):
            seen[i, k] = j[i, k] + h * dragged[i, k]
    equation.numbers(p).h = h


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
    unforced, nothing = equation.unforced(p), equation.nothing(p)
    for k in range(nothing.size):
        nothing[k] = 0.0
    residual.fill(p, velocity, nothing, unforced)
    for k in range(out.size):
        out[k] = unforced[k] / h


@exact
def answer_to(p, q, out):
    """Fill out with the velocity in which MuJoCo's step ends under a generalised force of the sand."""
    reset(p)
    prepare(p, equation.numbers(p).timestep)
    v, missing = equation.velocity(p), equation.unforced(p)
    residual.fill(p, v, q, missing)
    linearised.solution(p, v, missing, linearised.NONE, out)
