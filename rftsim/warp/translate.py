"""Kernels of the laws as functions of Warp, so that their arithmetic is stated once.

A kernel is Python over numbers and tuples (see `rftsim.machine.kernel`), which Warp reads nearly as it is. What it does
not is written anew here: the unpacking of what is no tuple, and names that stand for something else there.
"""

import ast
import inspect
import itertools
import linecache
import textwrap
import types
from collections.abc import Mapping
from typing import Any, Final

import warp as wp

from rftsim.machine.kernel import Kernel

LEAST: Final = 1e-30
"""Constants that are smaller than this stand for it: what avoids a division by zero, in single precision."""
_serial = itertools.count()


def translate(kernel: Kernel, names: Mapping[str, Any]) -> Any:
    """Make a function of Warp from a kernel and all kernels that it calls.

    Args:
        kernel: The kernel.
        names: What names stand for in Warp, dotted ones such as `medium.table` included: functions, constants, and
            tuples of them.

    Returns:
        A `warp.Function`, generic in its arguments.
    """
    return _Translation(names).of(kernel)


class _Translation:
    """Translates kernels that share what names stand for, each once."""

    def __init__(self, names: Mapping[str, Any]) -> None:
        self._names = names
        self._made: dict[int, Any] = {}

    def of(self, kernel: Kernel) -> Any:
        """The function of Warp that a kernel becomes."""
        if id(kernel) not in self._made:
            self._made[id(kernel)] = self._make(kernel.py_func)
        return self._made[id(kernel)]

    def _make(self, function: Any) -> Any:
        known = dict(function.__globals__) | _closed_over(function)
        rewriter = _Rewriter(known, self._names, self)
        tree = rewriter.visit(ast.parse(textwrap.dedent(inspect.getsource(function))))
        (definition,) = tree.body
        definition.decorator_list, definition.returns = [], None
        source = ast.unparse(ast.fix_missing_locations(tree))
        place = f"<{function.__module__}.{function.__name__} for Warp {next(_serial)}>"
        linecache.cache[place] = len(source), None, source.splitlines(keepends=True), place
        scope = {"Any": Any, "wp": wp, "__name__": __name__} | rewriter.used
        exec(compile(source, place, "exec"), scope)
        return wp.func(scope[function.__name__])


def _closed_over(function: Any) -> dict[str, Any]:
    """What a function's free variables hold."""
    cells = function.__closure__ or ()
    return dict(zip(function.__code__.co_freevars, (cell.cell_contents for cell in cells), strict=True))


class _Rewriter(ast.NodeTransformer):
    """Rewrites the body of a kernel, and collects what its names stand for."""

    def __init__(self, known: Mapping[str, Any], names: Mapping[str, Any], translation: _Translation) -> None:
        self._known, self._names, self._translation = known, names, translation
        self._temporaries = itertools.count()
        self.used: dict[str, Any] = {}

    def visit_Assign(self, node: ast.Assign) -> Any:
        """Unpack element by element what Warp may hold as a vector, or as several constants."""
        (target,), value = node.targets, node.value
        if not isinstance(target, ast.Tuple) or isinstance(value, ast.Tuple | ast.Call):
            return self.generic_visit(node)
        several = self._lookup(value)
        if isinstance(several, tuple):
            parts: list[ast.expr] = [self._constant(part) for part in several]
            return ast.copy_location(ast.Assign([target], ast.Tuple(parts, ast.Load())), node)
        whole = f"whole_{next(self._temporaries)}"
        out: list[ast.stmt] = [ast.Assign([ast.Name(whole, ast.Store())], self.visit(value))]
        for k, name in enumerate(target.elts):
            part = ast.Subscript(ast.Name(whole, ast.Load()), ast.Constant(k), ast.Load())
            out.append(ast.Assign([name], part))
        return [ast.copy_location(each, node) for each in out]

    def visit_Attribute(self, node: ast.Attribute) -> Any:
        """Name what a module holds, flat."""
        found = self._lookup(node)
        return self.generic_visit(node) if found is None else self._constant(found)

    def visit_Name(self, node: ast.Name) -> Any:
        """Name what is global, or closed over."""
        found = self._lookup(node) if isinstance(node.ctx, ast.Load) else None
        return node if found is None or isinstance(found, type | types.ModuleType) else self._constant(found)

    def _lookup(self, node: ast.expr) -> Any:
        """What an expression of names stands for, if it is known beforehand."""
        text = ast.unparse(node)
        if text in self._names:
            return self._names[text]
        first, *rest = text.split(".")
        if first not in self._known or not all(part.isidentifier() for part in (first, *rest)):
            return None
        found = self._known[first]
        for part in rest:
            if found is None or not isinstance(found, types.ModuleType):
                return None
            found = getattr(wp if found.__name__ == "numpy" else found, part, None)
        return found

    def _constant(self, value: Any) -> ast.expr:
        """An expression for a value that is known beforehand."""
        if isinstance(value, float):
            return ast.Constant(value if value == 0.0 or abs(value) >= LEAST else LEAST)
        if isinstance(value, Kernel):
            value = self._translation.of(value)
        name = f"known_{next(_serial)}"
        self.used[name] = value
        return ast.Name(name, ast.Load())
