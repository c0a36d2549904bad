"""How numba compiles what is compiled: kernels, helpers that are inlined, and loops.

Each decorator says what liberties the arithmetic takes, for numba lets a function that does not say inherit them from
whoever calls it first.
"""

import functools
from typing import Any

from numba import njit, types
from numba.extending import typeof_impl

from rftsim.machine.kernel import FASTMATH, Kernel

_REORDERED = set(FASTMATH)
exact = njit(fastmath=False, error_model="python")
"""Decorates functions that compute exactly as they are written, and that say so where they divide by zero."""
inline = njit(forceinline=True, fastmath=False, error_model="python")
"""Decorates what is inlined wherever it is called, and computes exactly as it is written."""
merged = njit(inline="always")
"""Decorates what becomes part of its caller before anything is optimised, and takes the liberties of that."""
inline_loop = njit(fastmath=_REORDERED, error_model="numpy", forceinline=True)
"""Decorates loops that are inlined where they are called; their arithmetic may be reordered."""
loop = njit(fastmath=_REORDERED, error_model="numpy")
"""Decorates loops that stand alone; their arithmetic may be reordered."""
fast = njit(fastmath=_REORDERED, error_model="python")
"""Decorates functions whose arithmetic may be reordered, and that say so where they divide by zero."""


@functools.cache
def compiled(kernel: Kernel) -> Any:
    """Give a kernel as numba's own function, which is inlined wherever it is called."""
    return (inline if kernel.exact else inline_loop)(kernel.py_func)


@typeof_impl.register(Kernel)
def _typeof(value: Kernel, context: Any) -> Any:
    """Tell numba what a kernel is that compiled code names."""
    return types.Dispatcher(compiled(value))
