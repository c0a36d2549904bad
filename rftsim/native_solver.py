"""The solver of the implicit force as a function of plain addresses; see `native`."""

from typing import Any, Final

from numba import cfunc, types

from rftsim import implicit
from rftsim.compiled import SOURCE
from rftsim.native import publish

_SIGNATURE: Final = types.void(types.intp)
solve = types.ExternalFunction("rftsim_solve", _SIGNATURE)


def _make(source: str) -> dict[str, Any]:
    """The function by name; it closes over `source`, see `compiled.SOURCE`."""

    @cfunc(_SIGNATURE, cache=True)
    def rftsim_solve(p):
        if source:
            implicit.solve(p)

    return {"rftsim_solve": rftsim_solve}


publish(_make(SOURCE))
