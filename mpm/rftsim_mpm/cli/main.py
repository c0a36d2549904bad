"""`rftsim-mpm`: every command, and how its errors end."""

import sys
from typing import Final

from rich.console import Console
from rich.markup import escape

from rftsim_mpm.cli.bench import Bench
from rftsim_mpm.cli.campaign import CAMPAIGNS
from rftsim_mpm.cli.case import CASES
from rftsim_mpm.cli.commands import Group, read
from rftsim_mpm.cli.ends import ERRORS, REFUSED, STOPPED, parsed, piped, said, terminable
from rftsim_mpm.cli.plate import PlateCommand
from rftsim_mpm.cli.push import PushCommand
from rftsim_mpm.cli.ruts import BladeCommand, FootprintCommand, RutCommand
from rftsim_mpm.cli.slope import SlopeCommand
from rftsim_mpm.cli.studies import CollapseCommand, DragCommand, WheelCommand

COMMANDS: Final = Group(
    "The granular continuum by the material point method: reference data for force laws.\n\n"
    "Example: rftsim-mpm plate --quick --plot plate.png",
    {
        "plate": PlateCommand,
        "slope": SlopeCommand,
        "push": PushCommand,
        "drag": DragCommand,
        "wheel": WheelCommand,
        "footprint": FootprintCommand,
        "blade": BladeCommand,
        "rut": RutCommand,
        "case": CASES,
        "collapse": CollapseCommand,
        "campaign": CAMPAIGNS,
        "bench": Bench,
    },
)


def main(arguments: list[str] | None = None) -> None:
    """Run the command that the arguments name.

    It exits with 2 where its input cannot be, with 130 after Ctrl-C, and with 141 where nobody reads what it prints.
    """
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    try:
        with terminable(), piped():
            parsed(lambda: read("rftsim-mpm", COMMANDS, sys.argv[1:] if arguments is None else arguments))()
    except KeyboardInterrupt:
        console.print("stopped")
        sys.exit(STOPPED)
    except ERRORS as error:
        console.print(f"[red]error:[/red] {escape(said(error))}")
        sys.exit(REFUSED)
