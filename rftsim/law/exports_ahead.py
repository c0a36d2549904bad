"""The laws' loops for the implicit force, as functions of plain addresses; see `native_law`."""

from typing import Final

import numpy as np
from numba import njit, types

from rftsim.law import kernels, kinematics, layout
from rftsim.law.exports import surface_at
from rftsim.machine.exports import address, entry
from rftsim.machine.memory import doubles, matrix, room

FRAME: Final = 15
"""Numbers that fix a body's frame for a step: up, rise, forward, height, rear (4), drop."""
RAMP: Final = 100.0
"""Steepness of the leading-edge rule in the implicit force: faces fall out between n.v_hat = 0 and -1/RAMP."""


@njit(forceinline=True)
def moving_frame(f, xmat, twist):
    """The frame of a body that moves with a twist, velocity first, world axes."""
    v0 = kinematics.to_body(xmat, twist[0], twist[1], twist[2])
    omega = kinematics.to_body(xmat, twist[3], twist[4], twist[5])
    up, rise, forward = (f[0], f[1], f[2]), (f[3], f[4], f[5]), (f[6], f[7], f[8])
    return kernels.Frame(v0, omega, up, rise, forward, f[9], (f[10], f[11], f[12], f[13]), f[14])


@njit(forceinline=True)
def _soft_medium(sand, surface):
    medium = kinematics.medium_of(sand, surface)
    return kernels.Medium(medium.xi, medium.mu_surf, medium.lambda_rho, medium.edge_on, RAMP, medium.table)


@njit(forceinline=True)
def _reach(surface, frame, h):
    """How far any triangle can move in a time h [m]."""
    x = max(abs(surface[1]), abs(surface[4]))
    y = max(abs(surface[2]), abs(surface[5]))
    z = max(abs(surface[3]), abs(surface[6]))
    v, w = frame.v0, frame.omega
    turn = np.sqrt((w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) * (x * x + y * y + z * z))
    return h * (np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + turn)


@entry(types.void, *[address] * 7)
def frame(sand, surface, xpos, xmat, velocity, omega, out):
    """What of a body's frame does not change within a step, (FRAME,)."""
    x, r, v, w = doubles(xpos, 3), doubles(xmat, 9), doubles(velocity, 3), doubles(omega, 3)
    f = kinematics.frame_of(doubles(sand, layout.SAND_SIZE), surface_at(surface), x, r, v, w)
    kept = doubles(out, FRAME)
    for k in range(3):
        kept[k], kept[3 + k], kept[6 + k] = f.up[k], f.rise[k], f.forward[k]
    for k in range(4):
        kept[10 + k] = f.rear[k]
    kept[9], kept[14] = f.height, f.drop


@entry(types.void, *[address] * 5, types.float64, types.float64, address)
def ahead(sand, surface, frame, xmat, twist, v_c, h, out):
    """Wrench continuous at rest, world frame: at the present depths, and at those after a time h, (12,)."""
    s, body, r = doubles(sand, layout.SAND_SIZE), surface_at(surface), doubles(xmat, 9)
    f, medium = moving_frame(doubles(frame, FRAME), r, doubles(twist, 6)), _soft_medium(s, body)
    total, reach = doubles(out, 12), _reach(body, f, h)
    if kinematics.lowest_corner(body, f) + reach <= 0.0:
        for k in range(12):
            total[k] = 0.0
        return
    if s[0] == 0.0:
        g = kernels.ahead_2d(body, f, medium, v_c, h, reach)
    elif s[0] == 1.0:
        g = kernels.ahead_3d(body, f, medium, v_c, h, reach)
    else:
        g = kernels.ahead_3d_quartic(body, f, medium, v_c, h, reach)
    for part in range(0, 12, 3):
        total[part], total[part + 1], total[part + 2] = kinematics.to_world(r, g[part], g[part + 1], g[part + 2])


@entry(types.void, *[address] * 5, types.float64, types.float64, address)
def jacobian(sand, surface, frame, xmat, twist, v_c, completed, out):
    """Derivative of `ahead`'s present wrench by the twist, world frame, (6, 6)."""
    s, body, r = doubles(sand, layout.SAND_SIZE), surface_at(surface), doubles(xmat, 9)
    f, medium = moving_frame(doubles(frame, FRAME), r, doubles(twist, 6)), _soft_medium(s, body)
    local, turned, g = matrix(room(36), 6, 6), matrix(room(36), 6, 6), matrix(out, 6, 6)
    for i in range(6):
        for k in range(6):
            local[i, k] = g[i, k] = 0.0
    if kinematics.lowest_corner(body, f) <= 0.0:
        return
    if s[0] == 0.0:
        kernels.jacobian_2d(body, f, medium, v_c, completed, local)
    elif s[0] == 1.0:
        kernels.jacobian_3d(body, f, medium, v_c, completed, local)
    else:
        kernels.jacobian_3d_quartic(body, f, medium, v_c, completed, local)
    for half in range(0, 6, 3):  # R G R'
        for k in range(6):
            x, y, z = kinematics.to_world(r, local[half, k], local[half + 1, k], local[half + 2, k])
            turned[half, k], turned[half + 1, k], turned[half + 2, k] = x, y, z
    for half in range(0, 6, 3):
        for k in range(6):
            x, y, z = kinematics.to_world(r, turned[k, half], turned[k, half + 1], turned[k, half + 2])
            g[k, half], g[k, half + 1], g[k, half + 2] = x, y, z
