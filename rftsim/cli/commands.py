"""The command that a command line's words name, out of a tree of commands."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple, Union

import tyro

from rftsim.cli.options import HELP


class Group(NamedTuple):
    """Commands by name, under one word."""

    says: str
    """What they are for, in a sentence."""
    commands: "Mapping[str, Callable[..., Any] | Group]"
    """Each command's class, whose docstring is its help, or a group of further ones."""


def read(program: str, group: Group, words: Sequence[str]) -> Any:
    """The command that some words name, made of its options; --help of a group lists what it has, a line each.

    Args:
        program: The words before these.
        group: What may follow.
        words: The words of a command line.

    Raises:
        SystemExit: They name no command, or ask for help.
    """
    named = group.commands.get(words[0]) if words else None
    if isinstance(named, Group):
        return read(f"{program} {words[0]}", named, words[1:])
    if named is not None:
        return tyro.cli(named, prog=f"{program} {words[0]}", args=words[1:], config=HELP)
    overview: Any = Union[tuple(_listed(name, one) for name, one in group.commands.items())]  # noqa: UP007
    return tyro.cli(overview, prog=program, description=group.says, args=list(words), config=HELP)


def _listed(name: str, one: "Callable[..., Any] | Group") -> Any:
    """A command as an overview has it: the first paragraph of its docstring."""
    if isinstance(one, Group):
        return Annotated[_Further, tyro.conf.subcommand(name, description=one.says.split("\n\n")[0])]
    says = " ".join((one.__doc__ or "").split("\n\n")[0].split())
    return Annotated[one, tyro.conf.subcommand(name, description=says)]


@dataclasses.dataclass(frozen=True)
class _Further:
    """Stands for a group in the overview of the one above it."""
