"""Functions that are Python here and machine code where compiled code calls them; see `compiling`.

A law is written in them, so that it can be listed, packed and read about in a process that has no numba.
"""

from collections.abc import Callable
from typing import Any, Final

FASTMATH: Final = frozenset({"reassoc", "contract", "arcp", "nsz"})
"""Floating-point liberties of all compiled loops: reordering vectorises them; what is no number stays none."""


class Kernel:
    """A function of numbers and tuples of numbers that compiled code takes in whole.

    Attributes:
        py_func: The function itself.
        exact: Whether it computes exactly as it is written; else with the liberties of the loops.
        targetoptions: What numba looks at where it merges functions.
    """

    def __init__(self, function: Callable[..., Any], exact: bool = False, inline: str = "never") -> None:
        self.py_func, self.exact, self.targetoptions = function, exact, {"inline": inline}
        self.__doc__, self.__name__ = function.__doc__, function.__name__

    def __call__(self, *arguments: Any) -> Any:
        """Call the function as Python."""
        return self.py_func(*arguments)


def kernel(function: Callable[..., Any]) -> Kernel:
    """Make a kernel whose arithmetic may be reordered as that of the loops is."""
    return Kernel(function)


def exact_kernel(function: Callable[..., Any]) -> Kernel:
    """Make a kernel that computes exactly as it is written, whoever calls it."""
    return Kernel(function, exact=True)


def merged_kernel(function: Callable[..., Any]) -> Kernel:
    """Make a kernel that becomes part of its caller before anything is optimised, and takes the liberties of that."""
    return Kernel(function, inline="always")
