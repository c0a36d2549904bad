"""Functions of plain addresses that the machine code offers by name; see `rftsim.machine`."""

from collections.abc import Callable
from typing import Any, Final

from numba import types

EXPORTED: Final[dict[str, tuple[Callable[..., Any], Any]]] = {}
"""Function and signature of each name."""

address = types.intp


def entry(returns: Any, *arguments: Any) -> Callable[[Callable[..., Any]], Any]:
    """Offer a function as `rftsim_<its name>`; compiled code that calls it calls that name.

    Args:
        returns: Type of what it returns.
        *arguments: Types of its arguments.
    """

    def offer(function: Callable[..., Any]) -> Any:
        name, signature = f"rftsim_{function.__name__}", returns(*arguments)
        EXPORTED[name] = function, signature
        return types.ExternalFunction(name, signature)

    return offer
