"""Sand in place of the floor of a model that was made without it in mind."""

import inspect
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import mujoco

from rftsim.law.laws import Law
from rftsim.model.add_sand import add_sand
from rftsim.sand.medium import Sand

OPTIONS: Final = frozenset(inspect.signature(add_sand).parameters) - {"spec", "sand", "law"}
"""Names of what `rftsim.add_sand` can be told beside the sand and the law."""


class Recipe(NamedTuple):
    """The sand that a floor turns to."""

    sand: "Sand | str | Mapping[str, Any]"
    """The medium, see `rftsim.make_sand`."""
    law: "Law | str"
    """A law or its name."""
    options: Mapping[str, Any]
    """Further options of `rftsim.add_sand`."""


def turn_to_sand(spec: mujoco.MjSpec, recipe: Recipe) -> None:
    """Turn the floor of a model that is not compiled yet to sand.

    Args:
        spec: The model; changed in place.
        recipe: What to turn it to.

    Raises:
        RftsimError: The scene cannot have sand.
    """
    add_sand(spec, recipe.sand, recipe.law, **recipe.options)
