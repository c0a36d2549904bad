"""The draft of a spec: a copy in which everything has a name, compiled and checked before the spec itself changes."""

from typing import Final, NamedTuple

import mujoco

from rftsim.model.start import start

TEMPORARY: Final = "rftsim-geom:"
"""Beginning of a draft's name of a geom that has none in the spec; its place in the spec follows."""


class Draft(NamedTuple):
    """A compiled copy of a spec whose bodies and geoms all have names."""

    model: mujoco.MjModel
    data: mujoco.MjData
    """Its data in the pose in which it starts, with kinematics and centres of mass."""
    bodies: list[str]
    """Names of the spec's bodies, in its order."""


def make_draft(spec: mujoco.MjSpec) -> Draft:
    """The draft of a spec, which stays as it is."""
    copy = spec.copy()
    bodies = _name_elements(copy)
    model = copy.compile()
    return Draft(model, start(model), bodies)


def _name_elements(copy: mujoco.MjSpec) -> list[str]:
    """Name the bodies that have no name, and geoms that have none after their place in the spec; the bodies' names."""
    taken = {body.name for body in copy.bodies}
    for number, body in enumerate(copy.bodies):
        if not body.name:
            body.name = next(n for k in range(len(taken) + 1) if (n := f"body{number + k}") not in taken)
            taken.add(body.name)
    for number, geom in enumerate(copy.geoms):
        geom.name = geom.name or f"{TEMPORARY}{number}"
    return [body.name for body in copy.bodies]


def name_bodies(spec: mujoco.MjSpec, draft: Draft) -> None:
    """Give a spec's bodies the names that they have in its draft."""
    for body, name in zip(spec.bodies, draft.bodies, strict=True):
        body.name = name


def geom_of(spec: mujoco.MjSpec, name: str) -> mujoco.MjsGeom:
    """The geom of a spec by its name in the draft."""
    place = name.removeprefix(TEMPORARY)
    return spec.geom(name) if place == name else spec.geoms[int(place)]


def shown(name: str) -> str:
    """The words by which messages name a geom of a draft."""
    return f"geom {name.removeprefix(TEMPORARY)}"
