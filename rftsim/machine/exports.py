"""Functions of plain addresses that the machine code offers by name; see `machine_code`.

Numba links whatever a compiled function calls into it and optimises all of it again, level by level. What is called
through a name is compiled once.
"""

from collections.abc import Callable
from typing import Any, Final

from numba import types

ENTRIES: Final[dict[str, tuple[Callable[..., Any], Any]]] = {}
"""Function and signature of each name."""

address = types.intp


def entry(returns: Any, *arguments: Any) -> Callable[[Callable[..., Any]], Any]:
    """Offer a function as `rftsim_<its name>`; what takes its place calls that name, from compiled code."""

    def offer(function: Callable[..., Any]) -> Any:
        name, signature = f"rftsim_{function.__name__}", returns(*arguments)
        ENTRIES[name] = function, signature
        return types.ExternalFunction(name, signature)

    return offer
