"""`rftsim`: every command, and how its errors end."""

import sys
import warnings
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.markup import escape

from rftsim.cli.bench import Bench
from rftsim.cli.demo import Demo
from rftsim.cli.drop import Drop
from rftsim.cli.ends import ERRORS, REFUSED, STOPPED, parsed, said, terminable, unlogged
from rftsim.cli.evaluate import Evaluate
from rftsim.cli.fit import Fit
from rftsim.cli.force import Force
from rftsim.cli.inspect import Inspect
from rftsim.cli.output import print_doubts, print_line
from rftsim.cli.play import Play
from rftsim.cli.run import Run
from rftsim.cli.train import Train
from rftsim.cli.validate import Validate
from rftsim.cli.view import View
from rftsim.errors import RftsimNote, RftsimWarning

Command = (
    Annotated[Force, tyro.conf.subcommand("force")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Drop, tyro.conf.subcommand("drop")]
    | Annotated[View, tyro.conf.subcommand("view")]
    | Annotated[Inspect, tyro.conf.subcommand("inspect")]
    | Annotated[Fit, tyro.conf.subcommand("fit")]
    | Annotated[Demo, tyro.conf.subcommand("demo")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
    | Annotated[Validate, tyro.conf.subcommand("validate")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Play, tyro.conf.subcommand("play")]
    | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
)


def main(arguments: list[str] | None = None) -> None:
    """Run the command that the arguments name; exit with 2 where its input cannot be, and with 130 after Ctrl-C."""
    console = Console(stderr=True)
    with terminable(), unlogged(), warnings.catch_warnings(record=True) as caught:
        for kind in (RftsimNote, RftsimWarning):
            warnings.simplefilter("always", kind)
        try:
            command = parsed(lambda: _parse(arguments))
            command(lambda: texts_of(caught, RftsimWarning))
        except KeyboardInterrupt:
            print_line(console, "stopped")
            sys.exit(STOPPED)
        except ERRORS as error:
            print_line(console, f"[red]error:[/red] {escape(said(error))}")
            sys.exit(REFUSED)
        except SystemExit:
            _print_notes(console, caught)
            raise
        _print_notes(console, caught)


def _parse(arguments: list[str] | None) -> Any:
    return tyro.cli(
        Command,
        prog="rftsim",
        description="Sand for MuJoCo: granular resistive forces on the bodies of any model.",
        args=arguments,
        config=(tyro.conf.OmitArgPrefixes,),
    )


def _print_notes(console: Console, caught: list[warnings.WarningMessage]) -> None:
    for note in texts_of(caught, RftsimNote):
        print_line(console, f"[cyan]note:[/cyan] {escape(note)}")
    print_doubts(console, texts_of(caught, RftsimWarning))


def texts_of(caught: list[warnings.WarningMessage], kind: type[Warning]) -> list[str]:
    """The texts of the distinct warnings of a kind, in the order in which they came."""
    return list(dict.fromkeys(str(warning.message) for warning in caught if issubclass(warning.category, kind)))
