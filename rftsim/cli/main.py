"""`rftsim`: every command, and how its errors end."""

import importlib.metadata
import sys
import warnings
from typing import Final

import mujoco
from rich.console import Console
from rich.markup import escape

from rftsim.cli.bench import Bench
from rftsim.cli.commands import Group, read
from rftsim.cli.demo import Demo
from rftsim.cli.drop import Drop
from rftsim.cli.ends import ERRORS, REFUSED, STOPPED, parsed, piped, said, terminable, unlogged
from rftsim.cli.evaluate import Evaluate
from rftsim.cli.fit import FIT
from rftsim.cli.force import Force
from rftsim.cli.inspect import Inspect
from rftsim.cli.output import print_doubts, print_line
from rftsim.cli.play import Play
from rftsim.cli.run import Run
from rftsim.cli.train import Train
from rftsim.cli.validate import Validate
from rftsim.cli.view import View
from rftsim.errors import RftsimNote, RftsimWarning

COMMANDS: Final = Group(
    "Sand for MuJoCo: granular resistive forces on the bodies of any model. `rftsim run --help` says more of one.\n\n"
    "Example: rftsim run robot.xml --sand poppy-seeds --picture run.png",
    {
        "run": Run,
        "view": View,
        "drop": Drop,
        "inspect": Inspect,
        "force": Force,
        "fit": FIT,
        "train": Train,
        "play": Play,
        "evaluate": Evaluate,
        "demo": Demo,
        "bench": Bench,
        "validate": Validate,
    },
)


def main(arguments: list[str] | None = None) -> None:
    """Run the command that the arguments name.

    It exits with 2 where its input cannot be, with 130 after Ctrl-C, and with 141 where nobody reads what it prints.
    """
    console, given = Console(stderr=True), sys.argv[1:] if arguments is None else arguments
    with terminable(), unlogged(), warnings.catch_warnings(record=True) as caught:
        for kind in (RftsimNote, RftsimWarning):
            warnings.simplefilter("always", kind)
        try:
            with piped():
                if given == ["--version"]:
                    print(f"rftsim {importlib.metadata.version('rftsim')}, MuJoCo {mujoco.__version__}")
                    return
                command = parsed(lambda: read("rftsim", COMMANDS, given))
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


def _print_notes(console: Console, caught: list[warnings.WarningMessage]) -> None:
    for note in texts_of(caught, RftsimNote):
        print_line(console, f"[cyan]note:[/cyan] {escape(note)}")
    print_doubts(console, texts_of(caught, RftsimWarning))


def texts_of(caught: list[warnings.WarningMessage], kind: type[Warning]) -> list[str]:
    """The texts of the distinct warnings of a kind, in the order in which they came."""
    return list(dict.fromkeys(str(warning.message) for warning in caught if issubclass(warning.category, kind)))
