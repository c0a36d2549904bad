"""Records for compiled code: what a NumPy dtype of float64 fields names, at an address."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.extending import intrinsic


def record_at(dtype: "np.dtype[Any]") -> Any:
    """A compiled function from an address to the record there, whose fields can be read and written."""
    record = from_dtype(dtype)

    @intrinsic
    def view(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return record(types.intp), generate

    return view


def record_behind(dtype: "np.dtype[Any]", entry: int) -> Any:
    """A compiled function from the address of a table of addresses to the record at one entry."""
    record = from_dtype(dtype)

    @intrinsic
    def view(typing_context: Any, table: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(_loaded(builder, arguments[0], entry), context.get_value_type(record))

        return record(types.intp), generate

    return view


def records_behind(dtype: "np.dtype[Any]", entry: int) -> Any:
    """A compiled function from the address of a table of addresses, and k, to the k-th record at one entry."""
    record = from_dtype(dtype)

    @intrinsic
    def view(typing_context: Any, table: Any, k: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            offset = builder.mul(arguments[1], ir.Constant(ir.IntType(64), dtype.itemsize))
            place = builder.add(_loaded(builder, arguments[0], entry), offset)
            return builder.inttoptr(place, context.get_value_type(record))

        return record(types.intp, types.intp), generate

    return view


def _loaded(builder: Any, table: Any, entry: int) -> Any:
    """The address at an entry of a table."""
    word = ir.IntType(64)
    return builder.load(builder.gep(builder.inttoptr(table, word.as_pointer()), [ir.Constant(word, entry)]))


def values_at(dtype: "np.dtype[Any]", kind: Any) -> Any:
    """A compiled function from an address to a named tuple of fields there, which loops can so keep in registers.

    Args:
        dtype: Names and places of the fields; vectors and matrices become tuples, and tuples of tuples.
        kind: The named tuple, of some of the fields.
    """
    fields = [dtype.fields[name] for name in kind._fields]  # type: ignore[index]
    result = types.NamedTuple([_type(field[0].shape) for field in fields], kind)

    @intrinsic
    def read(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            first = builder.inttoptr(arguments[0], ir.DoubleType().as_pointer())
            read = [_read(context, builder, first, field[1] // 8, field[0].shape) for field in fields]
            return context.make_tuple(builder, signature.return_type, read)

        return result(types.intp), generate

    return read


def _type(shape: tuple[int, ...]) -> Any:
    return types.UniTuple(_type(shape[1:]), shape[0]) if shape else types.float64


def _read(context: Any, builder: Any, first: Any, at: int, shape: tuple[int, ...]) -> Any:
    """Load a number, or a tuple of what the first axis holds."""
    if not shape:
        return builder.load(builder.gep(first, [ir.Constant(ir.IntType(64), at)]))
    size = int(np.prod(shape[1:]))
    parts = [_read(context, builder, first, at + k * size, shape[1:]) for k in range(shape[0])]
    return context.make_tuple(builder, _type(shape), parts)
