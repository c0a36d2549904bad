"""One time step of the implicit force as a function of plain addresses; see `native`."""

from typing import Any, Final

from numba import cfunc, types

from rftsim import stepping
from rftsim.compiled import SOURCE
from rftsim.native import publish

_signatures: Final = {
    "rftsim_is_needed": types.intc(types.intp),
    "rftsim_step": types.void(types.intp),
}
is_needed, step = (types.ExternalFunction(name, signature) for name, signature in _signatures.items())


def _make(source: str) -> dict[str, Any]:
    """The functions by name; each closes over `source`, see `compiled.SOURCE`."""

    @cfunc(_signatures["rftsim_is_needed"], cache=True)
    def rftsim_is_needed(p):
        return 1 if source and stepping.is_needed(p) else 0

    @cfunc(_signatures["rftsim_step"], cache=True)
    def rftsim_step(p):
        if source:
            stepping.step(p)

    return {"rftsim_is_needed": rftsim_is_needed, "rftsim_step": rftsim_step}


publish(_make(SOURCE))
