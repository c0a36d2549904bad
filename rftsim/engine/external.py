"""MuJoCo's own functions, for compiled code to call by name; addresses of mjModel and mjData go in."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.cgutils import get_or_insert_function
from numba.extending import intrinsic

from rftsim.engine.refusals import SYMBOL, WHY
from rftsim.machine.compiling import exact
from rftsim.machine.memory import int32s, int64s, named_address

fwd_actuation = types.ExternalFunction("mj_fwdActuation", types.void(types.intp, types.intp))
rne = types.ExternalFunction("mj_rne", types.void(types.intp, types.intp, types.intc, types.intp))
reference_constraint = types.ExternalFunction("mj_referenceConstraint", types.void(types.intp, types.intp))
is_sparse = types.ExternalFunction("mj_isSparse", types.intc(types.intp))
smooth_vel = types.ExternalFunction("mjd_smooth_vel", types.void(types.intp, types.intp, types.intc))
ray_geom = types.ExternalFunction(
    "mju_rayGeom",
    types.float64(types.intp, types.intp, types.intp, types.intp, types.intp, types.intc, types.intp),
)
"""From place, orientation and size of a geom, a point, a direction, and the geom's type; then where its normal goes."""

_free = types.ExternalFunction("mju_free", types.void(types.intp))
_refusals = named_address(SYMBOL)


def _telling(name: str) -> Any:
    """Make the function that calls one of MuJoCo's with a sentence and a text that stands in it."""

    @intrinsic
    def tell(typing_context: Any, sentence: Any, text: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            characters = ir.IntType(8).as_pointer()
            kind = ir.FunctionType(ir.VoidType(), [characters], var_arg=True)
            function = get_or_insert_function(builder.module, kind, name)
            builder.call(function, [builder.inttoptr(each, characters) for each in arguments])

        return types.void(types.intp, types.intp), generate

    return tell


_error, _warning = _telling("mju_error"), _telling("mju_warning")


@exact
def _sentence(why):
    """The address of a sentence of `refusals`."""
    return int64s(_refusals(), len(WHY))[why]


@exact
def warn(why, name):
    """Have MuJoCo warn with a sentence about what the name at an address is that of."""
    _warning(_sentence(why), name)


@exact
def refuse(data, d, why, name):
    """Raise MuJoCo's error with a sentence about a name, instead of making an mjData.

    MuJoCo's own way is to free it all and to say nothing but a number. Its struct is left, for it may be another's.
    """
    for place in (data.buffer, data.arena):
        memory = int64s(d + place, 1)
        _free(memory[0])
        memory[0] = 0
    int32s(d + data.nplugin, 1)[0] = 0
    _error(_sentence(why), name)
