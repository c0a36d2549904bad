"""Lengths, nesting, arguments and docstrings of the packages; as a script it lists what is out of bounds.

python tests/house.py [FOLDER ...]    # what is out of bounds below these folders, by default in all packages
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PACKAGES = ("rftsim", "envs/rftsim_envs", "mpm/rftsim_mpm", "models/rftsim_models")
LONGEST_MODULE = 350
LONGEST_FUNCTION = 60
"""Lines of a function, its docstring apart."""
DEEPEST = 4
"""Levels of if, for, while, with and try within a function."""
FEWEST_WORDS = 6
"""Words of a docstring's first sentence, of what is public."""
FRAGMENTS = ("What ", "Of ")
"""Beginnings of a docstring that is no sentence."""
COMPOUND = (ast.If, ast.For, ast.While, ast.With, ast.Try, ast.Match)


class Function(NamedTuple):
    """A function, where it stands, and its measures."""

    place: str
    lines: int
    depth: int
    arguments: int


class Docstring(NamedTuple):
    """A docstring of something public, and where it stands."""

    place: str
    text: str


def modules(folders: tuple[str, ...] = PACKAGES) -> list[Path]:
    """The Python files below some folders of the repository."""
    return [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]


def length(path: Path) -> int:
    """Lines of a module."""
    return len(path.read_text().splitlines())


def functions(path: Path) -> Iterator[Function]:
    """Every function of a module, those within others too."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef):
            yield Function(_place(path, node), _lines(node), _depth(node.body), _arguments(node))


def docstrings(path: Path) -> Iterator[Docstring]:
    """The docstrings of a module's public classes and functions, and its own."""
    tree = ast.parse(path.read_text())
    if text := ast.get_docstring(tree):
        yield Docstring(f"{path.relative_to(ROOT)}:1", text)
    yield from _docstrings(path, tree)


def _docstrings(path: Path, owner: ast.AST) -> Iterator[Docstring]:
    for node in ast.iter_child_nodes(owner):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            if text := ast.get_docstring(node):
                yield Docstring(_place(path, node), text)
            yield from _docstrings(path, node)


def is_fragment(text: str) -> bool:
    """Whether a docstring begins as no sentence does, or says next to nothing."""
    first = text.split("\n\n")[0].split(". ")[0]
    return text.startswith(FRAGMENTS) or len(first.split()) < FEWEST_WORDS


def _place(path: Path, node: ast.ClassDef | ast.FunctionDef) -> str:
    return f"{path.relative_to(ROOT)}:{node.lineno} {node.name}"


def _lines(node: ast.FunctionDef) -> int:
    lines = (node.end_lineno or 0) - node.lineno + 1
    first = node.body[0]
    if ast.get_docstring(node) is not None:
        lines -= (first.end_lineno or 0) - first.lineno + 1
    inner = [child for child in ast.walk(node) if isinstance(child, ast.FunctionDef) and child is not node]
    return lines - sum(_lines(child) for child in node.body if child in inner)


def _depth(body: list[ast.stmt], inside: int = 0) -> int:
    deepest = inside
    for node in body:
        if not isinstance(node, COMPOUND):
            continue
        blocks = [getattr(node, name, []) for name in ("body", "finalbody")]
        blocks += [handler.body for handler in getattr(node, "handlers", [])]
        blocks += [case.body for case in getattr(node, "cases", [])]
        otherwise = getattr(node, "orelse", [])
        is_elif = len(otherwise) == 1 and isinstance(otherwise[0], ast.If) and isinstance(node, ast.If)
        deepest = max(deepest, *(_depth(block, inside + 1) for block in blocks))
        deepest = max(deepest, _depth(otherwise, inside if is_elif else inside + 1))
    return deepest


def _arguments(node: ast.FunctionDef) -> int:
    a = node.args
    names = [x.arg for x in (*a.posonlyargs, *a.args, *a.kwonlyargs)]
    return len([name for name in names if name not in ("self", "cls")]) + (a.vararg is not None) + (a.kwarg is not None)


def main() -> None:
    """List what is out of bounds."""
    folders = tuple(sys.argv[1:]) or PACKAGES
    paths = modules(folders)
    found = [function for path in paths for function in functions(path)]
    for path in paths:
        if length(path) > LONGEST_MODULE:
            print(f"{path.relative_to(ROOT)}: {length(path)} lines")
    for function in found:
        if function.lines > LONGEST_FUNCTION or function.depth > DEEPEST:
            print(f"{function.place}: {function.lines} lines, {function.depth} levels")
    texts = [one for path in paths for one in docstrings(path)]
    bad = [one for one in texts if is_fragment(one.text)]
    for one in bad:
        print(f"{one.place}: {one.text.splitlines()[0]!r}")
    arguments = sorted(function.arguments for function in found)
    print(
        f"{len(paths)} modules, longest {max(map(length, paths))}; {len(found)} functions, longest "
        f"{max(f.lines for f in found)}, deepest {max(f.depth for f in found)}; arguments, 90th percentile "
        f"{arguments[int(0.9 * len(arguments))]}; {len(bad)} of {len(texts)} docstrings are fragments"
    )


if __name__ == "__main__":
    main()
