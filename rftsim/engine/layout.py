"""MuJoCo as compiled code must know it: where the fields of its structs lie, its constants, its functions.

The offsets are computed from MuJoCo's own description of its structs and then compared with the addresses that its
NumPy views report, so that a version of MuJoCo that lays them out otherwise is refused instead of misread.
"""

import ctypes
import functools
from pathlib import Path
from typing import Any, Final, NamedTuple

import llvmlite.binding as llvm
import mujoco
import numpy as np
from mujoco.introspect import ast_nodes, structs

from rftsim.engine import refusals
from rftsim.law import layout as law

_SCALARS: dict[str, type[Any]] = {
    "int": ctypes.c_int,
    "unsigned int": ctypes.c_uint,
    "float": ctypes.c_float,
    "double": ctypes.c_double,
    "char": ctypes.c_char,
    "unsigned char": ctypes.c_ubyte,
    "size_t": ctypes.c_size_t,
    "uintptr_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "int64_t": ctypes.c_int64,
    "mjtNum": ctypes.c_double,
    "mjtSize": ctypes.c_int64,
    "mjtByte": ctypes.c_ubyte,
    "mjtBool": ctypes.c_ubyte,
}


CONSTANTS: Final = {
    "euler": int(mujoco.mjtIntegrator.mjINT_EULER),
    "rk4": int(mujoco.mjtIntegrator.mjINT_RK4),
    "implicit": int(mujoco.mjtIntegrator.mjINT_IMPLICIT),
    "no_euler_damping": int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP),
    "no_damping": int(mujoco.mjtDisableBit.mjDSBL_DAMPER),
    "no_sensors": int(mujoco.mjtDisableBit.mjDSBL_SENSOR),
    "passive": int(mujoco.mjtPluginCapabilityBit.mjPLUGIN_PASSIVE),
    "equality": int(mujoco.mjtConstraint.mjCNSTR_EQUALITY),
    "dof_friction": int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF),
    "tendon_friction": int(mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON),
    "joint_limit": int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT),
    "tendon_limit": int(mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON),
    "frictionless_contact": int(mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS),
    "pyramidal_contact": int(mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL),
    "elliptic_contact": int(mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC),
    "touch": int(mujoco.mjtSensor.mjSENS_TOUCH),
    "force": int(mujoco.mjtSensor.mjSENS_FORCE),
    "torque": int(mujoco.mjtSensor.mjSENS_TORQUE),
    "sphere": int(mujoco.mjtGeom.mjGEOM_SPHERE),
    "box": int(mujoco.mjtGeom.mjGEOM_BOX),
}
"""Those that are compiled in."""
GIVEN: Final = repr(CONSTANTS) + law.GIVEN
"""All that machine code of the engine is made from beside its sources."""
FUNCTIONS: Final = (
    *("mj_fwdActuation", "mj_rne", "mj_referenceConstraint", "mj_isSparse", "mjd_smooth_vel", "mju_rayGeom"),
    *("mju_error", "mju_warning", "mju_free"),
)
"""Those that compiled code calls by name, see `external`."""
SYMBOL: Final = "rftsim_layout"
"""Where it reads the offsets, int64: those of Model, Data and Contact, one after another; see `offsets`."""


class LayoutError(ImportError):
    """This build of MuJoCo does not lay out its structs as it describes them."""


class Model(NamedTuple):
    """Byte offsets of fields in MuJoCo's struct mjModel."""

    nbody: int
    nv: int
    nu: int
    ntree: int
    nnumeric: int
    nnumericdata: int
    nnames: int
    nsite: int
    nsensor: int
    nsensordata: int
    nplugin: int
    npluginattr: int
    npluginstate: int
    body_parentid: int
    body_rootid: int
    body_dofnum: int
    body_dofadr: int
    body_plugin: int
    dof_parentid: int
    dof_treeid: int
    dof_invweight0: int
    numeric_adr: int
    numeric_size: int
    numeric_data: int
    site_bodyid: int
    site_type: int
    site_size: int
    sensor_type: int
    sensor_objid: int
    sensor_adr: int
    sensor_dim: int
    sensor_cutoff: int
    sensor_history: int
    sensor_historyadr: int
    sensor_delay: int
    sensor_interval: int
    sensor_plugin: int
    names: int
    name_bodyadr: int
    name_numericadr: int
    name_pluginadr: int
    plugin_attr: int
    plugin_attradr: int
    plugin_stateadr: int
    plugin_statenum: int
    M_rownnz: int
    M_rowadr: int
    M_colind: int
    D_rownnz: int
    D_rowadr: int
    D_colind: int
    dof_damping: int
    opt_timestep: int
    opt_integrator: int
    opt_disableflags: int


class Data(NamedTuple):
    """Byte offsets of fields in MuJoCo's struct mjData."""

    nefc: int
    nplugin: int
    buffer: int
    arena: int
    time: int
    history: int
    contact: int
    plugin_data: int
    plugin_state: int
    qvel: int
    qfrc_applied: int
    qfrc_actuator: int
    qfrc_bias: int
    xfrc_applied: int
    xipos: int
    M: int
    qDeriv: int
    efc_type: int
    efc_id: int
    efc_J: int
    efc_J_rownnz: int
    efc_J_rowadr: int
    efc_J_colind: int
    efc_D: int
    efc_aref: int
    efc_frictionloss: int
    efc_KBIP: int
    xpos: int
    xmat: int
    site_xpos: int
    site_xmat: int
    cvel: int
    subtree_com: int
    cdof: int
    qfrc_passive: int
    cfrc_int: int
    cfrc_ext: int
    sensordata: int


class Contact(NamedTuple):
    """Byte offsets in mjContact, and its size."""

    mu: int
    friction: int
    size: int


def _ctype(node: Any) -> Any:
    if isinstance(node, ast_nodes.PointerType):
        return ctypes.c_void_p
    if isinstance(node, ast_nodes.ArrayType):
        return functools.reduce(lambda inner, n: inner * n, reversed(node.extents), _ctype(node.inner_type))
    if isinstance(node, ast_nodes.AnonymousStructDecl):
        return _structure("anonymous", node.fields)
    if node.name in _SCALARS:
        return _SCALARS[node.name]
    if node.name in structs.STRUCTS:
        return _struct(node.name)
    if node.name.startswith("mjt"):  # an enum
        return ctypes.c_int
    raise LayoutError(f"MuJoCo {mujoco.__version__} describes a field of unknown type {node.name!r}")


def _structure(name: str, fields: Any) -> type[ctypes.Structure]:
    return type(name, (ctypes.Structure,), {"_fields_": [(field.name, _ctype(field.type)) for field in fields]})


@functools.cache
def _struct(name: str) -> type[ctypes.Structure]:
    return _structure(name, structs.STRUCTS[name].fields)


_PROBE = """
<mujoco>
  <worldbody><body><joint limited="true" range="10 20" damping="1" frictionloss="1"/><geom size="1"/><site/></body>
    <geom type="plane" size="1 1 1"/></worldbody>
  <option jacobian="sparse"/>
  <custom><numeric name="n" data="1 2"/></custom>
  <sensor><clock name="clock"/></sensor>
</mujoco>
"""


@functools.cache
def library() -> ctypes.CDLL:
    """MuJoCo's own shared library, which is loaded already."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in folder.glob(pattern):
            return ctypes.CDLL(str(path))
    raise LayoutError(f"no MuJoCo library beside {mujoco.__file__}")


@functools.cache
def publish() -> None:
    """Make the offsets and MuJoCo's functions known to compiled code, for as long as the process lives.

    Raises:
        LayoutError: MuJoCo's description of its structs does not hold.
    """
    offsets = [offset for part in layout() for offset in part]
    table = (ctypes.c_int64 * len(offsets))(*offsets)
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(table))
    llvm.add_symbol(SYMBOL, ctypes.addressof(table))
    for name in FUNCTIONS:
        llvm.add_symbol(name, ctypes.cast(getattr(library(), name), ctypes.c_void_p).value)
    refusals.publish()


def layout() -> tuple[Model, Data, Contact]:
    """The offsets of all three structs, verified against MuJoCo's own views.

    Raises:
        LayoutError: MuJoCo's description of its structs does not hold.
    """
    model_struct, data_struct = _struct("mjModel"), _struct("mjData")
    model_offsets = Model(*(_offset(model_struct, name) for name in Model._fields))
    data_offsets = Data(*(getattr(data_struct, name).offset for name in Data._fields))
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    _verify(model, model_struct.from_address(model._address), Model._fields)
    _verify(data, data_struct.from_address(data._address), Data._fields)
    contact = _struct("mjContact")
    memory = contact.from_address(data_struct.from_address(data._address).contact)
    if data.ncon != 1 or list(memory.friction) != data.contact.friction[0].tolist() or memory.mu != data.contact.mu[0]:
        raise LayoutError(f"MuJoCo {mujoco.__version__} lays out contacts otherwise than it says")
    return model_offsets, data_offsets, Contact(contact.mu.offset, contact.friction.offset, ctypes.sizeof(contact))


def _offset(struct: type[ctypes.Structure], name: str) -> int:
    """Offset of a field, or of `opt_x`, a field of the options."""
    if name.startswith("opt_"):
        return struct.opt.offset + getattr(_struct("mjOption"), name[4:]).offset  # type: ignore[no-any-return]
    return getattr(struct, name).offset  # type: ignore[no-any-return]


def _verify(owner: Any, memory: ctypes.Structure, names: tuple[str, ...]) -> None:
    for name in names:
        value, held = getattr(owner, name, None), getattr(memory, name, None)
        if name.startswith("opt_"):
            value, held = getattr(owner.opt, name[4:]), getattr(memory.opt, name[4:])
        if isinstance(value, np.ndarray) and value.size:
            expected: float = value.ctypes.data
        elif isinstance(value, int | float):
            expected = value
        else:
            continue  # an empty array, or the bytes of the names: nothing to compare with
        if held != expected:
            raise LayoutError(
                f"MuJoCo {mujoco.__version__} does not keep {name} where it says; rftsim needs mujoco>=3.5,<5"
            )
