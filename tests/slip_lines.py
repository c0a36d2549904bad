"""Bearing pressure of a smooth circle on frictional sand by slip lines, with associated flow: a slow, literal oracle.

Axial symmetry, r outward and z down, compression positive, the hoop stress the least (Haar and von Karman). With mean
stress s and the angle t of the largest stress from z towards r, on dr/dz = tan(t +- e), e = 45 deg - phi/2,

    ds +- 2 s tan(phi) dt = Z (dz -+ tan(phi) dr) + R (dr +- tan(phi) dz),

Z = gamma - s sin(phi) sin(2t) / r and R = -s sin(phi) (1 - cos(2t)) / r [Sokolovskii; Cox, Eason and Hopkins 1961].
"""

import itertools
import math

CORE = 0.1
"""Radius about the axis within which the pressure is extrapolated, over the diameter."""
Point = tuple[float, float, float, float]
"""r, z, mean stress and angle."""


def bearing_pressure(phi: float, depth: float, *, lines: int = 24) -> float:
    """Mean pressure on a circle of diameter one at a depth, over the weight of unit volume: what is above is a load.

    Args:
        phi: Angle of friction [rad].
        depth: Depth over the diameter [-].
        lines: Slip lines in the fan at the edge, 24 or more, and about as many across the surface beside it.
    """
    sine, edge = math.sin(phi), depth / (1.0 - math.sin(phi))
    fan = [math.pi / 2 * (1.0 - j / lines) for j in range(lines + 1)]
    line = [(0.5, 0.0, edge * math.exp(2.0 * math.tan(phi) * (math.pi / 2 - t)), t) for t in fan]
    base = [line[-1]]
    # The surface that fails is about as wide as the base times this; its points lie denser near the edge.
    reach = 0.5 * math.exp(0.5 * math.pi * math.tan(phi)) / lines
    outer = 0.5
    while base[-1][0] > CORE:
        outer += reach * min(1.0, 0.1 + len(base) / lines)
        new = [(outer, 0.0, edge, math.pi / 2)]
        for before in line:
            new.append(_meeting(new[-1], before, phi))
        new.append(_landing(new[-1], phi))
        line = new
        base.append(new[-1])
    places = [(q[0], q[2] * (1.0 + sine)) for q in base]
    rings = itertools.pairwise(places)
    total = sum(0.5 * (pa + pb) * (ra**2 - rb**2) for (ra, pa), (rb, pb) in rings)
    (ra, pa), (rb, pb) = places[-2:]
    power = math.log(pb / pa) / math.log(ra / rb)  # towards the axis it grows as a small power of 1 / r
    return 4.0 * (total + pb * rb**2 * 2.0 / (2.0 - power))


def _forced(a: Point, b: Point, phi: float, sign: float) -> float:
    """Right side of the equation along a step from a to b."""
    dr, dz = b[0] - a[0], b[1] - a[1]
    s, t, r = 0.5 * (a[2] + b[2]), 0.5 * (a[3] + b[3]), 0.5 * (a[0] + b[0])
    down = 1.0 - s * math.sin(phi) * math.sin(2.0 * t) / r
    out = -s * math.sin(phi) * (1.0 - math.cos(2.0 * t)) / r
    return down * (dz - sign * math.tan(phi) * dr) + out * (dr + sign * math.tan(phi) * dz)


def _slope(a: Point, b: Point, phi: float, sign: float) -> float:
    """Direction of a step, by the angle from z."""
    return 0.5 * (a[3] + b[3]) + sign * (math.pi / 4 - phi / 2)


def _meeting(plus: Point, minus: Point, phi: float) -> Point:
    """The point where a line of the one family from `plus` meets one of the other from `minus`."""
    tan, found = math.tan(phi), (minus[0], minus[1], 0.5 * (plus[2] + minus[2]), 0.5 * (plus[3] + minus[3]))
    for _ in range(12):
        a, b = _slope(plus, found, phi, 1.0), _slope(minus, found, phi, -1.0)
        dr, dz = minus[0] - plus[0], minus[1] - plus[1]
        along = (dr * math.cos(b) - dz * math.sin(b)) / math.sin(a - b)
        r, z = plus[0] + along * math.sin(a), plus[1] + along * math.cos(a)
        here = (r, z, found[2], found[3])
        f, g = _forced(plus, here, phi, 1.0), _forced(minus, here, phi, -1.0)
        p, m = (plus[2] + found[2]) * tan, (minus[2] + found[2]) * tan
        # s - s_plus + p (t - t_plus) = f and s - s_minus - m (t - t_minus) = g
        t = (f - g + plus[2] - minus[2] + p * plus[3] + m * minus[3]) / (p + m)
        found = (r, z, plus[2] + f - p * (t - plus[3]), t)
    return found


def _landing(plus: Point, phi: float) -> Point:
    """The point where a line from `plus` comes up to the base, on which the largest stress is vertical."""
    found = (plus[0], 0.0, plus[2], 0.0)
    for _ in range(12):
        r = plus[0] - plus[1] * math.tan(_slope(plus, found, phi, 1.0))
        here = (r, 0.0, found[2], 0.0)
        p = (plus[2] + found[2]) * math.tan(phi)
        found = (r, 0.0, plus[2] + _forced(plus, here, phi, 1.0) + p * plus[3], 0.0)
    return found
