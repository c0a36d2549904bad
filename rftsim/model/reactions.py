"""MuJoCo's account of the forces between bodies, with the sand in it."""

import ctypes
import functools
from typing import Any

import mujoco

from rftsim.engine import layout, plugin
from rftsim.machine import link


@functools.cache
def _add() -> Any:
    """The machine code's function of mjModel, mjData and a plugin instance."""
    address = link.load("engine", layout.GIVEN)("rftsim_add_to_reactions")
    return ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)(address)


def rne_post_constraint(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Call mj_rnePostConstraint, which knows no sand, and put the sand in its results.

    A step or mj_forward does so by itself, unless sensors are disabled. This is for whoever calls mj_rnePostConstraint
    afterwards, as Gymnasium's environments do: it makes the results anew from contacts and applied forces alone.
    Calling it again changes nothing.

    Args:
        model: A model with sand or without.
        data: Its data after mj_step, mj_forward or mj_inverse. `cfrc_ext`, shape (nbody, 6), gains each body's wrench
            [N m, N] about the centre of mass of the body's tree, moment first; `cfrc_int`, shape (nbody, 6), of the
            body and of all that it hangs on loses it.
    """
    mujoco.mj_rnePostConstraint(model, data)
    own = plugin.slots()
    for instance, slot in enumerate(model.plugin):
        if slot in own:
            _add()(model._address, data._address, instance)
