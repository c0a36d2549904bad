"""Raw memory for compiled code: typed views of addresses, and allocation without the interpreter lock."""

from typing import Any

from numba import carray, njit, types
from numba.extending import intrinsic


def _pointer(element: Any) -> Any:
    @intrinsic
    def cast(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return types.CPointer(element)(types.intp), generate

    return cast


_doubles, _int32s, _int64s, _bytes = (_pointer(t) for t in (types.float64, types.int32, types.int64, types.uint8))


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
def characters(address):
    """Pointer to the bytes at an address."""
    return _bytes(address)


@njit(forceinline=True)
def pointer(address):
    """The pointer, or 64-bit integer, at an address."""
    return int64s(address, 1)[0]


# The interpreter exports these symbols, and they need no interpreter lock.
allocate = types.ExternalFunction("PyMem_RawCalloc", types.intp(types.uintp, types.uintp))
release = types.ExternalFunction("PyMem_RawFree", types.void(types.intp))
