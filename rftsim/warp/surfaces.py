"""Surfaces of the bodies of a bed on Warp's device, and what moves them."""

from typing import Any, Final

import mujoco
import numpy as np
import warp as wp

from rftsim.errors import SceneError
from rftsim.law import layout
from rftsim.surface.triangles import Array

LANES: Final = 16
"""Threads that share the triangles of one body in one world, at most."""
EACH: Final = 2
"""Blocks of triangles that are worth a thread of their own."""


@wp.struct
class Surfaces:
    """Surfaces of the bodies of a bed, body frame; arrays over bodies, triangles and blocks of triangles."""

    body: wp.array(dtype=int)
    """Id of each body in the model."""
    first: wp.array(dtype=int)
    """First triangle of each body, and the number of all, (nbody + 1,)."""
    first_block: wp.array(dtype=int)
    """First block of each body, and the number of all, (nbody + 1,)."""
    edge_on: wp.array(dtype=float)
    gyration: wp.array(dtype=float)
    lowest: wp.array(dtype=wp.vec3)
    highest: wp.array(dtype=wp.vec3)
    axis: wp.array(dtype=wp.vec3)
    hub: wp.array(dtype=wp.vec3)
    radius: wp.array(dtype=float)
    """Of a wheel: its axis, centre and radius; zero where it is none."""
    start: wp.array(dtype=wp.vec3)
    """Direction at which a wheel's angles start."""
    centre: wp.array(dtype=wp.vec3)
    normal: wp.array(dtype=wp.vec3)
    area: wp.array(dtype=float)
    angle: wp.array(dtype=float)
    """Of a wheel's rim, about its axis; NO_RIM elsewhere."""
    middle: wp.array(dtype=wp.vec3)
    half: wp.array(dtype=wp.vec3)
    """The box of each block."""


def put_surfaces(bodies: dict[int, Array]) -> tuple[Any, int]:
    """Put packed surfaces on the device.

    Args:
        bodies: Packed surface of each body, by id, see `layout.pack_surface`.

    Returns:
        The surfaces, and how many threads should share one body.
    """
    headers = [layout.record(packed, layout.HEADER) for packed in bodies.values()]
    counts = [int(header.ntri) for header in headers]
    blocks = [-(-count // layout.BLOCK) for count in counts]
    columns = [np.array(layout.read_columns(packed)) for packed in bodies.values()]
    behind = [layout.HEADER_NUMBERS + layout.COLUMNS * count for count in counts]
    boxes = [
        packed[start : start + layout.BOX_NUMBERS * n].reshape(n, layout.BOX_NUMBERS)
        for packed, start, n in zip(bodies.values(), behind, blocks, strict=True)
    ]
    angles = [
        _angles(packed, header, start + layout.BOX_NUMBERS * n)
        for packed, header, start, n in zip(bodies.values(), headers, behind, blocks, strict=True)
    ]
    out, all_columns, all_boxes = Surfaces(), np.concatenate(columns, axis=1), np.concatenate(boxes)
    out.body = wp.array(list(bodies), dtype=int)
    out.first = wp.array(np.concatenate([[0], np.cumsum(counts)]), dtype=int)
    out.first_block = wp.array(np.concatenate([[0], np.cumsum(blocks)]), dtype=int)
    out.edge_on = wp.array([header.edge_on for header in headers], dtype=float)
    out.gyration = wp.array([header.gyration for header in headers], dtype=float)
    out.radius = wp.array([header.wheel_radius for header in headers], dtype=float)
    for name, field in (
        *(("lowest", "lowest"), ("highest", "highest"), ("axis", "wheel_axis"), ("hub", "wheel_centre")),
        ("start", "rim_start"),
    ):
        setattr(out, name, wp.array(np.array([header[field] for header in headers]), dtype=wp.vec3))
    out.centre, out.normal = (wp.array(all_columns[k : k + 3].T.copy(), dtype=wp.vec3) for k in (0, 3))
    out.area = wp.array(all_columns[6], dtype=float)
    out.angle = wp.array(np.concatenate(angles), dtype=float)
    out.middle, out.half = (wp.array(all_boxes[:, k : k + 3].copy(), dtype=wp.vec3) for k in (0, 3))
    return out, int(min(max(-(-max(blocks) // EACH), 1), LANES))


def _angles(packed: Array, header: Any, start: int) -> Array:
    """The angle of each triangle about a wheel's axis; NO_RIM where it is none."""
    count = int(header.ntri)
    if header.wheel_radius == 0.0:
        return np.full(count, layout.NO_RIM)
    return packed[start : start + count]


@wp.struct
class Paths:
    """The degrees of freedom that move the bodies of a bed, and the entries of the mass matrix that they couple."""

    dof: wp.array(dtype=int)
    """The degrees of freedom that move each body, one body after another; a pair of body and one is a motion."""
    owner: wp.array(dtype=int)
    """The body of each motion, by its place in the bed."""
    first: wp.array(dtype=int)
    """First motion of each body, and the number of all, (nbody + 1,)."""
    of_dof: wp.array(dtype=int)
    """The motions by each degree of freedom, one after another."""
    first_of_dof: wp.array(dtype=int)
    """First of these of each, and the number of all, (nv + 1,)."""
    row_motion: wp.array(dtype=int)
    column_motion: wp.array(dtype=int)
    """Pairs of motions of the same body that share an entry of the mass matrix, one entry after another."""
    first_of_entry: wp.array(dtype=int)
    """First of these of each entry, and the number of all, (nC + 1,)."""


def put_paths(model: mujoco.MjModel, bodies: "list[int]") -> Any:
    """Put on the device what moves bodies of a model.

    Args:
        model: The compiled model.
        bodies: Ids of the bodies of a bed.
    """
    paths = [_path(model, body) for body in bodies]
    firsts = np.concatenate([[0], np.cumsum([len(path) for path in paths])])
    dofs = np.concatenate([np.array(path, dtype=int) for path in paths]).astype(int)
    owners = np.repeat(np.arange(len(bodies)), np.diff(firsts))
    place = [{dof: int(first) + k for k, dof in enumerate(path)} for first, path in zip(firsts, paths, strict=False)]
    of_dof = [np.flatnonzero(dofs == dof) for dof in range(model.nv)]
    of_entry: list[list[tuple[int, int]]] = []
    _check_coupled(model, paths, bodies)
    for row in range(model.nv):
        start = int(model.M_rowadr[row])
        for column in model.M_colind[start : start + int(model.M_rownnz[row])]:
            of_entry.append([(own[row], own[int(column)]) for own in place if row in own and int(column) in own])
    pairs = np.array([pair for some in of_entry for pair in some], dtype=int).reshape(-1, 2)
    out = Paths()
    out.dof, out.owner, out.first = (wp.array(x, dtype=int) for x in (dofs, owners, firsts))
    out.of_dof, out.first_of_dof = _lists(of_dof)
    out.row_motion, out.column_motion = (wp.array(pairs[:, k].copy(), dtype=int) for k in (0, 1))
    out.first_of_entry = wp.array(np.concatenate([[0], np.cumsum([len(some) for some in of_entry])]), dtype=int)
    return out


def _check_coupled(model: mujoco.MjModel, paths: "list[list[int]]", bodies: "list[int]") -> None:
    """Refuse a model whose mass matrix has no entries for what the sand couples."""
    for path, body in zip(paths, bodies, strict=True):
        if any(model.M_rownnz[dof] < k + 1 for k, dof in enumerate(path)):
            raise SceneError(
                f"MuJoCo keeps only the diagonal of the mass matrix of body {model.body(body).name!r}: "
                "put the MjSpec in place of the compiled model, or shift the body's inertia by a micrometre"
            )


def _lists(lists: "list[Any]") -> tuple[Any, Any]:
    """Lists one after another, and where each starts."""
    starts = np.concatenate([[0], np.cumsum([len(some) for some in lists])])
    return wp.array(np.concatenate(lists) if lists else np.empty(0), dtype=int), wp.array(starts, dtype=int)


def _path(model: mujoco.MjModel, body: int) -> list[int]:
    """The degrees of freedom that move a body, rising."""
    while body > 0 and model.body_dofnum[body] == 0:
        body = int(model.body_parentid[body])
    dof = int(model.body_dofadr[body] + model.body_dofnum[body] - 1) if body > 0 else -1
    path = []
    while dof >= 0:
        path.append(dof)
        dof = int(model.dof_parentid[dof])
    return path[::-1]
