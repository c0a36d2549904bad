"""The laws' loops as functions of plain addresses.

Addresses are of packed sand, packed surface, xpos (3,), xmat (9,), and so on, all float64.
"""

from numba import njit, types

from rftsim.law import kernels, kinematics, layout
from rftsim.machine.exports import address, entry
from rftsim.machine.memory import doubles, matrix


@njit(forceinline=True)
def surface_at(place):
    """The packed surface at an address."""
    return doubles(place, kinematics.size_of(doubles(place, layout.HEADER)))


@entry(types.void, *[address] * 7)
def wrench(sand, surface, xpos, xmat, velocity, omega, out):
    """Force and moment about the body's origin, world frame, (6,), at the velocity of the moment."""
    s, body = doubles(sand, layout.SAND_SIZE), surface_at(surface)
    x, r, v, w = doubles(xpos, 3), doubles(xmat, 9), doubles(velocity, 3), doubles(omega, 3)
    total = doubles(out, 6)
    for k in range(6):
        total[k] = 0.0
    if kinematics.is_clear(s, body, x, r):
        return
    f, medium = kinematics.frame_of(s, body, x, r, v, w), kinematics.medium_of(s, body)
    if s[0] == 0.0:
        g = kernels.sums_2d(body, f, medium)
    elif s[0] == 1.0:
        g = kernels.sums_3d(body, f, medium)
    else:
        g = kernels.sums_3d_quartic(body, f, medium)
    total[0], total[1], total[2] = kinematics.to_world(r, g[0], g[1], g[2])
    total[3], total[4], total[5] = kinematics.to_world(r, g[3], g[4], g[5])


@entry(types.void, *[address] * 8)
def tractions(sand, surface, xpos, xmat, velocity, omega, stress, depth):
    """Stress of each triangle in the body frame, (ntri, 3), and effective depth, (ntri,)."""
    s, body = doubles(sand, layout.SAND_SIZE), surface_at(surface)
    x, r, v, w = doubles(xpos, 3), doubles(xmat, 9), doubles(velocity, 3), doubles(omega, 3)
    f, medium = kinematics.frame_of(s, body, x, r, v, w), kinematics.medium_of(s, body)
    cx, cy, cz, nx, ny, nz, area = kinematics.columns(body)
    n = area.size
    stress_out, depth_out = matrix(stress, n, 3), doubles(depth, n)
    if s[0] == 0.0:
        kernels.tractions_2d(cx, cy, cz, nx, ny, nz, f, medium, stress_out, depth_out)
    elif s[0] == 1.0:
        kernels.tractions_3d(cx, cy, cz, nx, ny, nz, f, medium, stress_out, depth_out)
    else:
        kernels.tractions_3d_quartic(cx, cy, cz, nx, ny, nz, f, medium, stress_out, depth_out)
