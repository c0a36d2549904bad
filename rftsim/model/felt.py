"""Which bodies of a model feel the sand, with what surface, and why."""

import dataclasses
import difflib
from typing import Final, NamedTuple

import mujoco
import numpy as np

from rftsim.errors import SceneError
from rftsim.law import layout
from rftsim.law.evaluate import crosses
from rftsim.model.geometry import bounding_geoms, colliding, own_geoms
from rftsim.model.reach import clearance
from rftsim.model.shaping import Fineness, Shaping, shape
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.terrain import Terrain
from rftsim.surface.triangles import Array, Surface

CLEAR: Final = 0.1
"""Height over the sand, over the body's size, from which on a body counts as out of reach."""
FEW: Final = 5
"""Bodies whose reasons an error tells."""


class Choice(NamedTuple):
    """The bodies of a model that are to feel the sand, and what of their surfaces."""

    bodies: frozenset[str] | None
    """Names of bodies; None for all that can."""
    fineness: Fineness
    """Which geoms bound them, and how."""
    plane: Array | None
    """Normal of the plane of motion under a planar law, shape (3,)."""
    terrain: "FreeSurface | Terrain | None"
    """Surface of the sand where bodies that cannot reach it are to be left out."""


class Felt(NamedTuple):
    """The bodies of a model that feel the sand, and the reasons for all."""

    surfaces: dict[str, Surface]
    """Surface of each body that feels the sand, by body name."""
    reasons: dict[str, str]
    """Why each body of the model does or does not feel it, by body name."""
    choices: list[str]
    """Sentences about how the surfaces were made, one for each kind of choice."""
    doubts: list[str]
    """Sentences about what of them is doubtful, one for each kind."""


def felt_bodies(model: mujoco.MjModel, data: mujoco.MjData, choice: Choice) -> Felt:
    """The chosen bodies with their surfaces, in blocks of triangles that lie close together.

    Args:
        model: Compiled.
        data: Its data at the start, with kinematics.
        choice: Which bodies, and what of their surfaces.

    Raises:
        SceneError: A chosen body does not exist or cannot feel the sand, or no body would.
        SurfaceError: A mesh does not bound a body, nor does its hull.
    """
    names = [model.body(i).name for i in range(model.nbody)]
    _check_chosen(choice.bodies or frozenset(), names)
    told = []
    if choice.fineness.geoms == "collision" and not _any_collides(model):
        choice = choice._replace(fineness=choice.fineness._replace(geoms="all"))
        told = ["no geom of a body that moves collides, so that all of them are felt"]
    unfit = {body: _unfit(model, body, names[body], choice) for body in range(1, model.nbody)}
    shaping = shape(model, [body for body, why in unfit.items() if not why], choice.fineness)
    surfaces, reasons = _within_reach(model, data, unfit, shaping, choice)
    felt = Felt(surfaces, reasons, [*shaping.choices, *told], [*shaping.doubts, *_mocap_doubts(model, unfit)])
    if not felt.surfaces and choice.terrain is not None and shaping.surfaces:
        surfaces, reasons = _within_reach(model, data, unfit, shaping, choice._replace(terrain=None))
        doubt = "no body can come down to the sand, as its joints go: put the sand higher (terrain=)"
        felt = Felt(surfaces, reasons, felt.choices, [*felt.doubts, doubt])
    if not felt.surfaces:
        raise SceneError(
            f"no body would feel the sand ({_said(felt.reasons)}). Bodies need geoms that collide, or geoms='all'; "
            '<compiler discardvisual="true"/> deletes the others'
        )
    return felt


def _within_reach(
    model: mujoco.MjModel, data: mujoco.MjData, unfit: dict[int, str], shaping: Shaping, choice: Choice
) -> tuple[dict[str, Surface], dict[str, str]]:
    """Surfaces of the bodies that feel the sand, in blocks, and the reasons for all, by body name."""
    surfaces, reasons = {}, {}
    for body, why in unfit.items():
        name = model.body(body).name
        surface, reasons[name] = (None, why) if why else _felt_surface(model, body, shaping, choice)
        if surface is not None and choice.plane is not None:
            surface, reasons[name] = _carrying(surface, data.xmat[body].reshape(3, 3).T @ choice.plane)
        if surface is not None:
            surfaces[name] = surface.clustered(layout.BLOCK)
        elif choice.bodies is not None and name in choice.bodies:
            raise SceneError(f"body {name!r} cannot feel the sand: it {reasons[name]}")
    return surfaces, reasons


def _any_collides(model: mujoco.MjModel) -> bool:
    """Whether a geom that moves can collide with anything."""
    return bool((colliding(model) & (model.body_weldid[model.geom_bodyid] != 0)).any())


def _said(reasons: dict[str, str]) -> str:
    """The reasons of the first few bodies."""
    told = [f"{name}: {why}" for name, why in reasons.items()]
    more = [f"and {len(told) - FEW} more"] if len(told) > FEW else []
    return "; ".join(told[:FEW] + more) or "the model has no bodies"


def _check_chosen(chosen: frozenset[str], names: list[str]) -> None:
    for unknown in sorted(chosen - set(names)):
        near = difflib.get_close_matches(unknown, names, 3, 0.0)
        raise SceneError(f"no body {unknown!r}; near are {', '.join(near)}")
    if names[0] in chosen:
        raise SceneError(f"{names[0]!r} is the world, which cannot move: name bodies that can")


def _unfit(model: mujoco.MjModel, body: int, name: str, choice: Choice) -> str:
    """Why a body cannot feel the sand, whatever its surface; empty where it can."""
    if choice.bodies is not None and name not in choice.bodies:
        return "not among the bodies asked for"
    if hangs_on_mocap(model, body):
        return "hangs on a mocap body, to which MuJoCo gives no velocity: hold a body with a free joint by a weld to it"
    if model.body_weldid[body] == 0:
        return "cannot move"
    if model.body_plugin[body] >= 0:
        return "has another plugin, or sand already"
    if not bounding_geoms(model, body, choice.fineness.geoms):
        return "has no geom that collides" if model.body_geomnum[body] else "has no geom"
    return ""


def hangs_on_mocap(model: mujoco.MjModel, body: int) -> bool:
    """Whether a body is a mocap body or hangs on one, whose motion is in no velocity of MuJoCo's."""
    return bool(model.body_mocapid[model.body_rootid[body]] >= 0)


def _mocap_doubts(model: mujoco.MjModel, unfit: dict[int, str]) -> list[str]:
    """The doubt about mocap bodies that could touch sand and feel none, if there are any."""
    names = [
        model.body(body).name
        for body, why in unfit.items()
        if why.startswith("hangs on a mocap") and colliding(model)[own_geoms(model, body)].any()
    ]
    if not names:
        return []
    more = f" and {len(names) - FEW} more" if len(names) > FEW else ""
    return [
        f"no sand acts on {', '.join(names[:FEW])}{more}, as MuJoCo gives a mocap body, and what hangs on it, no "
        "velocity by the motion of its pose: hold a body with a free joint by a weld to it"
    ]


def _felt_surface(model: mujoco.MjModel, body: int, shaping: Shaping, choice: Choice) -> tuple[Surface | None, str]:
    """The part of a body's surface that feels the sand, None where nothing does, and why."""
    surface = shaping.surfaces.get(body)
    if surface is None:
        return None, "lies inside bodies that it is fixed to, or has no geom with a surface"
    if choice.terrain is not None:
        above = clearance(model, body, surface, choice.terrain)
        if above > CLEAR * surface.size:
            return None, f"stays {above:.3g} m or more above the sand, by its tree and its joints' ranges"
    return surface, f"moves, {surface.ntri} triangles"


def _carrying(surface: Surface, plane: Array) -> tuple[Surface, str]:
    """The part of a surface that a planar law can press on, and why: faces parallel to the plane carry nothing.

    Args:
        surface: The body's surface.
        plane: Normal of the plane of motion, body frame, in which the body stays.
    """
    carries = crosses(surface.normals, plane)
    if carries.all() or not carries.any():
        return surface, f"moves, {surface.ntri} triangles"
    return (
        dataclasses.replace(surface, triangles=surface.triangles[carries]),
        f"moves in the plane; {np.count_nonzero(~carries)} of {surface.ntri} triangles are parallel to it and left out",
    )
