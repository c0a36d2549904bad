"""Bodies under planar laws, whose motion the joints and equalities of a model have to keep in the plane of motion."""

import copy
from collections.abc import Iterable
from typing import Final

import mujoco
import numpy as np

from rftsim.errors import SceneError
from rftsim.law import layout
from rftsim.law.laws import LAWS, Law
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.terrain import Terrain
from rftsim.surface.triangles import Array

_JOINT = mujoco.mjtJoint
SMALL: Final = 1e-5
"""Share of a motion across the plane that is rounding: model files have six digits."""
RANK: Final = 1e-9
"""Share of the largest singular value below which an equality holds nothing."""
FEW: Final = 3
"""Names that an error tells before it counts the others."""
_AXES: Final = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}
_KINDS: Final = {_JOINT.mjJNT_FREE: "free joint", _JOINT.mjJNT_BALL: "ball joint", _JOINT.mjJNT_SLIDE: "slide"}


def check_planar(
    model: mujoco.MjModel, data: mujoco.MjData, bodies: Iterable[str], law: Law, plane: Array | None
) -> None:
    """Refuse bodies that can leave the plane of motion of a planar law, which has no force against that.

    Args:
        model: Compiled.
        data: Its data at the start, with kinematics and centres of mass.
        bodies: Names of the bodies that feel the sand.
        law: The law of its force.
        plane: Normal of the plane of motion, shape (3,); None where the law is not planar, which keeps nothing in one.

    Raises:
        SceneError: A body can leave the plane.
    """
    if plane is None:
        return
    found = {name: joints_that_leave(model, data, model.body(name).id, plane) for name in bodies}
    leaving = [name for name, joints in found.items() if joints]
    if not leaving:
        return
    joints = list(dict.fromkeys(joint for joints in found.values() for joint in joints))
    owners = {model.body(model.jnt_bodyid[joint]).name for joint in joints}
    own = len(leaving) == 1 and owners == set(leaving)
    by = [
        f"its {_named(model, joint)}" if own else f"the {_named(model, joint)}{_of(model, joint)}" for joint in joints
    ]
    raise SceneError(
        f"{law.name} acts in the plane across ({_said(plane)}), and {_list(leaving)} can leave it by {_list(by)}: "
        f"give {'it' if len(leaving) == 1 else 'them'} {_planar_joints(plane)}, or take {_law_in_space(law)}"
    )


def plane_of(bed: Array, law: Law, terrain: "FreeSurface | Terrain") -> Array | None:
    """The normal of the plane of motion of a planar law, shape (3,); None where the law is not planar.

    Args:
        bed: Packed sand.
        law: The law of its force.
        terrain: Surface of the sand.

    Raises:
        SceneError: The terrain rises across the plane, which a planar law knows nothing of.
    """
    if not law.planar:
        return None
    plane: Array = layout.record(bed, layout.BED).plane
    if isinstance(terrain, FreeSurface):
        return plane
    along_x, along_y = terrain.slopes()
    steepest = float(np.abs(plane[0] * along_x + plane[1] * along_y).max())
    if steepest > SMALL:
        raise SceneError(
            f"{law.name} acts in the plane across ({_said(plane)}), and the terrain rises by up to "
            f"{np.degrees(np.arctan(steepest)):.3g} degrees across it: take one that is the same all across, or "
            f"{_law_in_space(law)}"
        )
    return plane


def joints_that_leave(model: mujoco.MjModel, data: mujoco.MjData, body: int, plane: Array) -> list[int]:
    """The joints by which a body can leave a plane or turn out of it, as far as the active equalities let them.

    Slides along the plane and hinges about its normal keep a body in it in every pose, if they do in one.

    Args:
        model: Compiled.
        data: Its data at the start, with kinematics and centres of mass.
        body: The body's id.
        plane: Normal of the plane, shape (3,).
    """
    velocity, omega = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, velocity, omega, body)
    across = np.vstack([plane @ velocity, omega - np.outer(plane, plane @ omega)])
    if not _is_motion(across, velocity, omega).any():
        return []
    free = _free_motions(model, data)
    leaves = _is_motion(across @ free, velocity @ free, omega @ free)
    takes_part = np.abs(free[:, leaves]).max(axis=1, initial=0.0) > SMALL
    return list(dict.fromkeys(model.dof_jntid[takes_part & _is_motion(across, velocity, omega)].tolist()))


def _is_motion(across: Array, velocity: Array, omega: Array) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    """Whether the parts of motions across a plane, (4, n), are more than rounding of the whole, (n,)."""
    whole = np.linalg.norm(np.vstack([velocity, omega]), axis=0)
    result: np.ndarray[tuple[int], np.dtype[np.bool_]] = np.linalg.norm(across, axis=0) > SMALL * np.maximum(whole, 1.0)
    return result


def _free_motions(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """A basis of the joints' velocities that the active equalities allow at the start, (nv, k)."""
    if not model.neq:
        return np.eye(model.nv)
    held = copy.copy(data)
    mujoco.mj_flex(model, held)
    mujoco.mj_tendon(model, held)
    mujoco.mj_makeConstraint(model, held)
    rows = _jacobian(model, held)[held.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)]
    _, share, basis = np.linalg.svd(rows)
    rank = int(np.count_nonzero(share > RANK * share.max(initial=0.0)))
    free: Array = basis[rank:].T
    return free


def _jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """The Jacobian of all constraints, (nefc, nv)."""
    dense = np.zeros((data.nefc, model.nv))
    if mujoco.mj_isSparse(model):
        mujoco.mju_sparse2dense(dense, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    else:
        dense[:] = data.efc_J.reshape(data.nefc, model.nv)
    return dense


def _named(model: mujoco.MjModel, joint: int) -> str:
    """The words for a joint: its kind, and its name where it has one."""
    kind, name = _KINDS.get(_JOINT(model.jnt_type[joint]), "hinge"), model.joint(joint).name
    return f"{kind} {name!r}" if name else kind


def _of(model: mujoco.MjModel, joint: int) -> str:
    return f" of {model.body(model.jnt_bodyid[joint]).name}"


def _list(names: list[str]) -> str:
    told = names if len(names) <= FEW else [*names[: FEW - 1], f"{len(names) - FEW + 1} more"]
    return " and ".join([", ".join(told[:-1]), told[-1]] if len(told) > 1 else told)


def _planar_joints(plane: Array) -> str:
    """The joints that would keep a body in a plane."""
    for about, along in (("y", "x"), ("x", "y")):
        if abs(plane @ _AXES[about]) > 1.0 - SMALL:
            return f"slides along {along} and z and a hinge about {about}"
    return "two slides along that plane and a hinge about its normal"


def _law_in_space(law: Law) -> str:
    """The 3D law that is to a planar one what there is."""
    name = law.name.replace("2d", "3d")
    return name if name in LAWS and name != law.name else "a 3D law"


def _said(normal: Array) -> str:
    return ", ".join(f"{x + 0.0:.3g}" for x in normal)
