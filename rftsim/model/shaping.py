"""Surfaces of a model's bodies, put together from their geoms: those of a rigid part united, as fine as asked."""

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import mujoco

from rftsim.errors import RftsimError, SurfaceError
from rftsim.model.geometry import LARGER, Geoms, Meshes, Part, bounding_geoms, colliding, geom_label, geom_part
from rftsim.surface.shapes import FINENESS
from rftsim.surface.triangles import Array, Surface, joined
from rftsim.surface.union import overlapping, united


class Fineness(NamedTuple):
    """The geoms that bound bodies, how their meshes are felt, and how fine their triangles are."""

    geoms: Geoms = "collision"
    """Those that can collide, or also the others of bodies that have none."""
    meshes: Meshes = "hull"
    """Convex hulls, or the meshes themselves where they are closed."""
    max_edge: float | None = None
    """Longest edge of a triangle [m]; None for a sixth of each geom's size."""


class Shaping(NamedTuple):
    """The surfaces of bodies, and what is to be said of how they were made."""

    surfaces: dict[int, Surface]
    """Surface of each body that has one outside the other bodies of its rigid part, by body id."""
    choices: list[str]
    """Sentences about choices, one for each kind."""
    doubts: list[str]
    """Sentences about what is doubtful, one for each kind."""


class _United(NamedTuple):
    """What became of the geoms of a rigid part."""

    shown: dict[int, Surface]
    """The shown part of each geom's surface, in the frame of its body, by geom id; none of those wholly inside."""
    hidden: float
    """Share of the geoms' area that lies inside others [-]."""
    trouble: str
    """Why overlapping geoms could not be united; empty where they could."""


def shape(model: mujoco.MjModel, bodies: Iterable[int], fineness: Fineness) -> Shaping:
    """The surfaces of bodies, each in its own frame.

    Geoms of one body, and of bodies that no joint parts, are united where they overlap: what lies inside another
    presses on no sand.

    Args:
        model: Compiled.
        bodies: Ids of the bodies.
        fineness: Geoms, meshes and edges.

    A geom without a surface that the sand could press on, as a flat mesh, is left out and said.
    """
    chosen: list[int] = list(bodies)
    empty: list[str] = []
    parts: dict[int, list[Part]] = {body: _parts(model, body, fineness, empty) for body in chosen}
    surfaces, unions = {}, {}
    for rigid, members in itertools.groupby(sorted(chosen, key=lambda b: model.body_weldid[b]), model.body_weldid.item):
        group = [body for body in members if parts[body]]
        unions[rigid] = _unite(model, group, parts)
        for body in group:
            shown = unions[rigid].shown
            own = [
                shown[part.geom].refined(fineness.max_edge or part.surface.size / FINENESS)
                for part in parts[body]
                if part.geom in shown
            ]
            if own:
                surfaces[body] = joined(own)
    ordered = {body: surfaces[body] for body in chosen if body in surfaces}
    hulls = [part for own in parts.values() for part in own if part.hull]
    names = {rigid: model.body(rigid).name for rigid in unions}
    return Shaping(
        ordered,
        [*_say_hulls(model, hulls, fineness.meshes), *_say_unions(unions, names)],
        [
            *_one_a_kind(empty),
            *_one_a_kind([note for surface in ordered.values() for note in surface.notes]),
            *_troubles(unions, names),
        ],
    )


def _parts(model: mujoco.MjModel, body: int, fineness: Fineness, empty: list[str]) -> list[Part]:
    """The surfaces of the geoms that bound a body; `empty` takes sentences about those that have none."""
    can_collide, found = colliding(model), []
    for geom in bounding_geoms(model, body, fineness.geoms):
        try:
            found.append(geom_part(model, geom, fineness.meshes == "hull" and bool(can_collide[geom])))
        except RftsimError as error:
            empty.append(f"{geom_label(model, geom)} (left out): {error}")
    return found


def body_surface(model: mujoco.MjModel, body: int, fineness: Fineness) -> Surface | None:
    """The surface of one body in its own frame, or None where it has none."""
    return shape(model, [body], fineness).surfaces.get(body)


def _unite(model: mujoco.MjModel, group: Sequence[int], parts: dict[int, list[Part]]) -> _United:
    """Unite the geoms of bodies that no joint parts, as the bodies stand at the reference pose."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    owner = [body for body in group for _ in parts[body]]
    flat = [part for body in group for part in parts[body]]
    place = {body: (data.xmat[body].reshape(3, 3), data.xpos[body]) for body in group}
    placed = [part.surface.moved(*place[body]) for body, part in zip(owner, flat, strict=True)]
    shown: dict[int, Surface] = {}
    trouble, whole = "", sum(float(part.surface.areas.sum()) for part in flat)
    for numbers in overlapping(placed):
        found: Sequence[Surface | None] = [flat[k].surface for k in numbers]
        if len(numbers) > 1:
            try:
                joint = united([placed[k] for k in numbers])
            except SurfaceError as error:
                trouble = str(error)
            else:
                found = [None if s is None else _back(s, *place[owner[k]]) for s, k in zip(joint, numbers, strict=True)]
        shown |= {flat[k].geom: surface for k, surface in zip(numbers, found, strict=True) if surface is not None}
    left = sum(float(surface.areas.sum()) for surface in shown.values())
    return _United(shown, 1.0 - left / whole if whole else 0.0, trouble)


def _back(surface: Surface, rotation: Array, translation: Array) -> Surface:
    return surface.moved(rotation.T, -rotation.T @ translation)


def _say_hulls(model: mujoco.MjModel, hulls: list[Part], meshes: Meshes) -> list[str]:
    """The line about convex hulls, if there are any."""
    if not hulls:
        return []
    count = f"{len(hulls)} mesh geom{'s' if len(hulls) > 1 else ''}"
    are, their = ("are", "their convex hulls") if len(hulls) > 1 else ("is", "its convex hull")
    if meshes == "exact":
        return [f"{count} {are} open and felt as {their}"]
    gaps = sum(math.isnan(part.excess) for part in hulls)
    text = f"{count} {are} felt as {their}, as MuJoCo collides with them{f' ({gaps} open)' if gaps else ''}"
    larger = [part for part in hulls if part.excess >= LARGER]
    if larger:
        worst = max(larger, key=lambda part: part.excess)
        mesh = model.mesh(model.geom_dataid[worst.geom]).name
        text += (
            f"; {len(larger)} of the hulls hold {LARGER:g} times their mesh or more ({mesh} {worst.excess:.3g}): "
            "meshes='exact' feels closed meshes themselves"
        )
    return [text]


def _say_unions(unions: dict[Any, _United], names: dict[Any, str]) -> list[str]:
    """The line about united geoms, if there are any."""
    done = {rigid: union.hidden for rigid, union in unions.items() if union.hidden > 1e-6}
    if not done:
        return []
    worst = max(done, key=lambda rigid: done[rigid])
    return [
        f"overlapping geoms are united in {len(done)} bod{'ies' if len(done) > 1 else 'y'}: the sand does not press on "
        f"what lies inside another geom (of {names[worst]} {100 * done[worst]:.2g} % of the area)"
    ]


def _troubles(unions: dict[Any, _United], names: dict[Any, str]) -> list[str]:
    failed = [rigid for rigid, union in unions.items() if union.trouble]
    if not failed:
        return []
    return [
        f"overlapping geoms of {', '.join(names[rigid] for rigid in failed)} could not be united and count twice where "
        f"they overlap: {unions[failed[0]].trouble}"
    ]


def _one_a_kind(notes: list[str]) -> list[str]:
    """Of notes that differ in their mesh and numbers only, the first, with how many more there are."""
    kinds: dict[str, list[str]] = {}
    for note in notes:
        words = note.rpartition(")")[2] if ")" in note else note
        kinds.setdefault("".join(c for c in words if not c.isdigit()), []).append(note)
    return [own[0] + (f" (and {len(own) - 1} more like it)" if len(own) > 1 else "") for own in kinds.values()]
