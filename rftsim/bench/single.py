"""The laws' loop in single precision, for measuring alone: the package's own source with each number a float32."""

import ast
import functools
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numba  # not `from`: what measures the package is not part of what its machine code is made from
import numpy as np

from rftsim.law import kernels, kinematics, selection
from rftsim.surface.triangles import Array

LARGEST: Final = 1e30
"""Constants that single precision cannot hold are taken for this, or one over it."""


class Single(NamedTuple):
    """The law's loop in both precisions on one body."""

    triangles: int
    double_nanoseconds: float
    """Of one triangle."""
    single_nanoseconds: float
    error: float
    """Of the wrench, its largest component's, over double precision's."""


def measure(
    sand: Array, body: Array, motion: tuple[Array, ...], least: Callable[[list[Callable[[int], Any]]], list[float]]
) -> Single:
    """Time both.

    Args:
        sand: Packed.
        body: Packed.
        motion: Position, rotation, velocity and angular velocity.
        least: Times pieces of work in turn, see `kernel`.
    """
    frame, medium = kinematics.frame_of(sand, body, *motion), kinematics.medium_of(sand, body)
    works: list[Callable[[int], Any]] = []
    out = []
    for loop, number in ((kernels.sums_3d, np.float64), (_single(), np.float32)):
        out.append(np.zeros(6))
        own = body.astype(number), _as(number, frame), _as(number, medium)
        works.append(functools.partial(_repeated(loop), *own, out[-1]))
    double, single = least(works)
    error, count = float(np.abs(out[1] - out[0]).max() / np.abs(out[0]).max()), int(body[14])
    return Single(count, 1e9 * double / count, 1e9 * single / count, error)


def _repeated(loop: Any) -> Any:
    @numba.njit(error_model="numpy")
    def repeated(body, frame, medium, out, count):  # type: ignore[no-untyped-def]
        for _ in range(count):
            g = loop(body, frame, medium)
            for k in range(6):
                out[k] = g[k]

    return repeated


def _as(number: Any, value: Any) -> Any:
    """Nested tuples with each number in another precision."""
    if not isinstance(value, tuple):
        return number(np.clip(value, -LARGEST, LARGEST) if number is np.float32 else value)
    parts = [_as(number, part) for part in value]
    return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)


def _single() -> Any:
    """`kernels.sums_3d` in single precision."""
    chosen = _rewritten(selection.__file__, {})
    return _rewritten(kernels.__file__, chosen)["sums_3d"]


def _rewritten(path: "str | None", given: dict[str, Any]) -> dict[str, Any]:
    """A module's names, after its source was run with each number a float32; `given` is instead of what it imports."""
    tree = _Singly().visit(ast.parse(Path(str(path)).read_text()))
    module = types.ModuleType("single")
    module.__dict__.update({"_single": np.float32, **given})
    if given:
        tree.body = [
            line for line in tree.body if not (isinstance(line, ast.ImportFrom) and line.module == selection.__name__)
        ]
    exec(compile(ast.fix_missing_locations(tree), str(path), "exec"), module.__dict__)
    return module.__dict__


class _Singly(ast.NodeTransformer):
    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if not isinstance(node.value, float):
            return node
        size = min(max(abs(node.value), 1.0 / LARGEST), LARGEST) if node.value else 0.0
        return ast.Call(ast.Name("_single", ast.Load()), [ast.Constant(size)], [])

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        self.generic_visit(node)
        return ast.Attribute(node.value, "float32", node.ctx) if node.attr == "float64" else node
