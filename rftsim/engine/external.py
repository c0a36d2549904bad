"""MuJoCo's own functions, for compiled code to call by name; addresses of mjModel and mjData go in."""

import ctypes
from typing import Final

import llvmlite.binding as llvm
from numba import types

_NAMES: Final = ("mj_fwdActuation", "mj_rne", "mj_referenceConstraint", "mj_isSparse", "mjd_smooth_vel")

fwd_actuation = types.ExternalFunction("mj_fwdActuation", types.void(types.intp, types.intp))
rne = types.ExternalFunction("mj_rne", types.void(types.intp, types.intp, types.intc, types.intp))
reference_constraint = types.ExternalFunction("mj_referenceConstraint", types.void(types.intp, types.intp))
is_sparse = types.ExternalFunction("mj_isSparse", types.intc(types.intp))
smooth_vel = types.ExternalFunction("mjd_smooth_vel", types.void(types.intp, types.intp, types.intc))


def link(library: ctypes.CDLL) -> None:
    """Make the functions known by name."""
    for name in _NAMES:
        llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
