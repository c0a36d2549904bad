"""Motion of the bodies as MuJoCo's arrays give it, and forces on them as MuJoCo's arrays take them."""

from typing import Any, NamedTuple

from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, int32s, pointer


class Tree(NamedTuple):
    """Views of the kinematic tree and its motion."""

    parent: Any
    root: Any
    dofnum: Any
    dofadr: Any
    dof_parent: Any
    xpos: Any
    xmat: Any
    cvel: Any
    com: Any
    cdof: Any


@exact
def tree(model, data, m, d):
    """Views of mjModel's and mjData's arrays, flat."""
    nbody, nv = pointer(m + model.nbody), pointer(m + model.nv)
    return Tree(
        int32s(pointer(m + model.body_parentid), nbody),
        int32s(pointer(m + model.body_rootid), nbody),
        int32s(pointer(m + model.body_dofnum), nbody),
        int32s(pointer(m + model.body_dofadr), nbody),
        int32s(pointer(m + model.dof_parentid), nv),
        doubles(pointer(d + data.xpos), 3 * nbody),
        doubles(pointer(d + data.xmat), 9 * nbody),
        doubles(pointer(d + data.cvel), 6 * nbody),
        doubles(pointer(d + data.subtree_com), 3 * nbody),
        doubles(pointer(d + data.cdof), 6 * nv),
    )


@exact
def arm(t, body, x):
    """From the point that cvel and cdof refer to, to a point x."""
    o = 3 * t.root[body]
    return x[0] - t.com[o], x[1] - t.com[o + 1], x[2] - t.com[o + 2]


@exact
def twist(t, body, velocity_out, omega_out):
    """Fill the velocity of a body's origin and its angular velocity, (3,) each."""
    c = t.cvel[6 * body : 6 * body + 6]  # MuJoCo's cvel: angular first
    r = arm(t, body, t.xpos[3 * body : 3 * body + 3])
    velocity_out[0] = c[3] + c[1] * r[2] - c[2] * r[1]
    velocity_out[1] = c[4] + c[2] * r[0] - c[0] * r[2]
    velocity_out[2] = c[5] + c[0] * r[1] - c[1] * r[0]
    omega_out[0], omega_out[1], omega_out[2] = c[0], c[1], c[2]


@exact
def last_dof(t, body):
    """The last degree of freedom that moves a body, or -1."""
    while body > 0 and t.dofnum[body] == 0:
        body = t.parent[body]
    return t.dofadr[body] + t.dofnum[body] - 1 if body > 0 else -1


@exact
def add_wrench(t, body, x, force, moment, out):
    """Add a force at x and a moment on a body to a generalised force, through the body's Jacobian."""
    fx, fy, fz = force
    r = arm(t, body, x)
    tx = moment[0] + r[1] * fz - r[2] * fy
    ty = moment[1] + r[2] * fx - r[0] * fz
    tz = moment[2] + r[0] * fy - r[1] * fx
    dof = last_dof(t, body)
    while dof >= 0:
        c = t.cdof[6 * dof : 6 * dof + 6]
        out[dof] += c[0] * tx + c[1] * ty + c[2] * tz + c[3] * fx + c[4] * fy + c[5] * fz
        dof = t.dof_parent[dof]


@exact
def motion_by(t, body, dof, out):
    """Fill out with the twist of a body about its origin by a degree of freedom that moves it, velocity first, (6,)."""
    r, c = arm(t, body, t.xpos[3 * body : 3 * body + 3]), t.cdof[6 * dof : 6 * dof + 6]
    out[0] = c[3] + c[1] * r[2] - c[2] * r[1]
    out[1] = c[4] + c[2] * r[0] - c[0] * r[2]
    out[2] = c[5] + c[0] * r[1] - c[1] * r[0]
    out[3], out[4], out[5] = c[0], c[1], c[2]
