"""Raw memory for compiled code: typed views of addresses, and memory without the interpreter and its lock."""

from typing import Any

from llvmlite import ir
from numba import carray, njit, types
from numba.core.cgutils import alloca_once
from numba.extending import intrinsic


def _pointer(element: Any) -> Any:
    @intrinsic
    def cast(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return types.CPointer(element)(types.intp), generate

    return cast


_doubles, _int32s, _int64s, _uint64s, _bytes = (
    _pointer(t) for t in (types.float64, types.int32, types.int64, types.uint64, types.uint8)
)


@njit(forceinline=True)
def doubles(address, size):
    """View of `size` float64 at an address."""
    return carray(_doubles(address), (size,))


@njit(forceinline=True)
def matrix(address, rows, columns):
    """View of rows x columns float64 at an address, row by row."""
    return carray(_doubles(address), (rows, columns))


@njit(forceinline=True)
def int32s(address, size):
    """View of `size` int32 at an address."""
    return carray(_int32s(address), (size,))


@njit(forceinline=True)
def int64s(address, size):
    """View of `size` int64 at an address."""
    return carray(_int64s(address), (size,))


@njit(forceinline=True)
def uint64s(address, size):
    """View of `size` uint64 at an address."""
    return carray(_uint64s(address), (size,))


@njit(forceinline=True)
def bytes_at(address, size):
    """View of `size` bytes at an address."""
    return carray(_bytes(address), (size,))


@njit(forceinline=True)
def pointer(address):
    """The pointer, or 64-bit integer, at an address."""
    return int64s(address, 1)[0]


def named_address(name: str) -> Any:
    """A compiled function that gives the address of what is published under a name."""

    @intrinsic
    def find(typing_context: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            module = builder.module
            place = module.globals.get(name) or ir.GlobalVariable(module, ir.IntType(64), name)
            return builder.ptrtoint(place, context.get_value_type(types.intp))

        return types.intp(), generate

    return find


@intrinsic(prefer_literal=True)
def stack_doubles(typing_context: Any, size: Any) -> Any:
    """The address of so many float64, a constant, that live as long as the calling function runs."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _reserved(builder, ir.DoubleType(), size.literal_value)
        return builder.ptrtoint(place, context.get_value_type(types.intp))

    return (types.intp(size), generate) if isinstance(size, types.IntegerLiteral) else None


def _reserved(builder: Any, element: Any, size: int) -> Any:
    """Space on the stack of the function under construction; the optimiser can tell it from all other."""
    place = alloca_once(builder, ir.ArrayType(element, size))
    place.align = 64
    return place


def on_stack(size: int, element: Any) -> Any:
    """Make what gives compiled code a pointer to `size` numbers on its function's stack."""

    @intrinsic
    def reserve(typing_context: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place = _reserved(builder, context.get_value_type(element), size)
            return builder.bitcast(place, context.get_value_type(signature.return_type))

        return types.CPointer(element)(), generate

    return reserve


def _place(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    return builder.gep(array.data, [arguments[1]])


@intrinsic
def peek(typing_context: Any, array: Any, index: Any) -> Any:
    """The number of a contiguous array at an index that is not negative, on which numba's own way there spends time."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_place(context, builder, signature, arguments))

    return array.dtype(array, types.intp), generate


@intrinsic
def poke(typing_context: Any, array: Any, index: Any, number: Any) -> Any:
    """Set the number of a contiguous array at an index that is not negative."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _place(context, builder, signature, arguments))

    return types.void(array, types.intp, array.dtype), generate


# The interpreter exports these symbols, and they need no interpreter lock.
take = types.ExternalFunction("PyMem_RawMalloc", types.intp(types.uintp))
allocate = types.ExternalFunction("PyMem_RawCalloc", types.intp(types.uintp, types.uintp))
release = types.ExternalFunction("PyMem_RawFree", types.void(types.intp))


def tuples(size: int, element: Any) -> Any:
    """Make what reads `size` numbers at an address into a tuple; numba's own way there keeps a tuple in memory."""

    @intrinsic
    def read(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            first = builder.inttoptr(arguments[0], context.get_value_type(element).as_pointer())
            places = (builder.gep(first, [ir.Constant(ir.IntType(64), k)]) for k in range(size))
            return context.make_tuple(builder, signature.return_type, [builder.load(place) for place in places])

        return types.UniTuple(element, size)(types.intp), generate

    return read
