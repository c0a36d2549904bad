"""Four numbers side by side, which compiled code adds and multiplies at once; numba has no type for them.

The last four of a row of eight, and what is added to them:

    force = load(grid, node, 4)
    store(grid, node, 4, force + weight * four(0.0, fx, fy, fz))

They are written out, since numba leaves LLVM's own search for such fours (SLP) switched off.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

_VECTOR = ir.VectorType(ir.DoubleType(), 4)
_ALIGNMENT = 8
"""Alignment that is known of where a row begins [bytes]."""


class Four(types.Type):
    """The type of four float64 in one register, or in two where registers are short."""

    def __init__(self) -> None:
        super().__init__(name="Four")


FOUR = Four()


@register_model(Four)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


def _lane_number(i: int) -> ir.Constant:
    return ir.Constant(ir.IntType(32), i)


def _built(builder: Any, values: Any) -> Any:
    found = ir.Constant(_VECTOR, ir.Undefined)
    for i, value in enumerate(values):
        found = builder.insert_element(found, value, _lane_number(i))
    return found


def _pointer(context: Any, builder: Any, kind: Any, array: Any, row: Any, column: Any) -> Any:
    """Pointer to array[row, column], without a look at bounds or signs."""
    found = cgutils.get_item_pointer(
        context, builder, kind, context.make_array(kind)(context, builder, array), (row, column), wraparound=False
    )
    return builder.bitcast(found, _VECTOR.as_pointer())


@intrinsic
def four(typing, a, b, c, d):
    """Join four numbers into one value of type Four."""

    def generate(context, builder, signature, arguments):
        return _built(builder, arguments)

    return FOUR(*[types.float64] * 4), generate


@intrinsic
def lane(typing, vector, i):
    """Return one of the four numbers; which one must be known when compiled."""
    if not isinstance(i, types.IntegerLiteral):
        return None

    def generate(context, builder, signature, arguments):
        return builder.extract_element(arguments[0], _lane_number(i.literal_value))

    return types.float64(FOUR, i), generate


@intrinsic
def load(typing, array, row, column):
    """Return array[row, column : column + 4] as one value; neither index may be negative."""

    def generate(context, builder, signature, arguments):
        return builder.load(_pointer(context, builder, array, *arguments), align=_ALIGNMENT)

    return FOUR(array, types.uintp, types.uintp), generate


@intrinsic
def store(typing, array, row, column, vector):
    """Set array[row, column : column + 4] to the four numbers of a value; neither index may be negative."""

    def generate(context, builder, signature, arguments):
        builder.store(arguments[3], _pointer(context, builder, array, *arguments[:3]), align=_ALIGNMENT)
        return context.get_dummy_value()

    return types.void(array, types.uintp, types.uintp, FOUR), generate


@type_callable(operator.add)
@type_callable(operator.iadd)
def _type_sum(context):
    return lambda a, b: FOUR if a == FOUR and b == FOUR else None


@lower_builtin(operator.add, FOUR, FOUR)
@lower_builtin(operator.iadd, FOUR, FOUR)
def _sum(context, builder, signature, arguments):
    return builder.fadd(*arguments)


@type_callable(operator.mul)
def _type_multiple(context):
    return lambda a, b: FOUR if a == types.float64 and b == FOUR else None


@lower_builtin(operator.mul, types.float64, FOUR)
def _multiple(context, builder, signature, arguments):
    return builder.fmul(_built(builder, [arguments[0]] * 4), arguments[1])
