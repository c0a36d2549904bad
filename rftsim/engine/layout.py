"""Where the fields of mjModel and mjData lie in memory, for compiled code that is handed their addresses.

The offsets are computed from MuJoCo's own description of its structs and then compared with the addresses that its
NumPy views report, so that a version of MuJoCo that lays them out otherwise is refused instead of misread.
"""

import ctypes
import functools
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.introspect import ast_nodes, structs

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


class LayoutError(ImportError):
    """This build of MuJoCo does not lay out its structs as it describes them."""


class Model(NamedTuple):
    """Byte offsets in mjModel."""

    nbody: int
    nv: int
    nnumeric: int
    nsensor: int
    nplugin: int
    body_parentid: int
    body_rootid: int
    body_dofnum: int
    body_dofadr: int
    body_plugin: int
    dof_parentid: int
    numeric_adr: int
    numeric_size: int
    numeric_data: int
    sensor_objid: int
    sensor_adr: int
    sensor_plugin: int
    names: int
    name_bodyadr: int
    name_numericadr: int
    name_pluginadr: int


class Data(NamedTuple):
    """Byte offsets in mjData."""

    plugin_data: int
    qvel: int
    xpos: int
    xmat: int
    cvel: int
    subtree_com: int
    cdof: int
    qfrc_passive: int
    sensordata: int


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
  <worldbody><body><joint/><geom size="1"/></body></worldbody>
  <custom><numeric name="n" data="1 2"/></custom>
  <sensor><clock name="clock"/></sensor>
</mujoco>
"""


@functools.cache
def layout() -> tuple[Model, Data]:
    """The offsets, verified.

    Raises:
        LayoutError: MuJoCo's description of its structs does not hold.
    """
    model_struct, data_struct = _struct("mjModel"), _struct("mjData")
    model_offsets = Model(*(getattr(model_struct, name).offset for name in Model._fields))
    data_offsets = Data(*(getattr(data_struct, name).offset for name in Data._fields))
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    _verify(model, model_struct.from_address(model._address), Model._fields)
    _verify(data, data_struct.from_address(data._address), Data._fields)
    return model_offsets, data_offsets


def _verify(owner: Any, memory: ctypes.Structure, names: tuple[str, ...]) -> None:
    for name in names:
        value = getattr(owner, name, None)
        if isinstance(value, np.ndarray) and value.size:
            expected = value.ctypes.data
        elif isinstance(value, int):
            expected = value
        else:
            continue  # an empty array, or the bytes of the names: nothing to compare with
        if getattr(memory, name) != expected:
            raise LayoutError(
                f"MuJoCo {mujoco.__version__} does not keep {name} where it says; rftsim needs mujoco>=3.17,<4"
            )
