"""`rftsim-mpm`: every command, and how its errors end."""

import sys
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.markup import escape

from rftsim_mpm.cli.bench import Bench
from rftsim_mpm.cli.campaign import CampaignCommand
from rftsim_mpm.cli.case import CaseCommand
from rftsim_mpm.cli.ends import ERRORS, REFUSED, STOPPED, parsed, said, terminable
from rftsim_mpm.cli.plate import PlateCommand
from rftsim_mpm.cli.push import PushCommand
from rftsim_mpm.cli.slope import SlopeCommand
from rftsim_mpm.cli.studies import CollapseCommand, DragCommand, WheelCommand

Command = (
    Annotated[PlateCommand, tyro.conf.subcommand("plate")]
    | Annotated[SlopeCommand, tyro.conf.subcommand("slope")]
    | Annotated[PushCommand, tyro.conf.subcommand("push")]
    | Annotated[DragCommand, tyro.conf.subcommand("drag")]
    | Annotated[WheelCommand, tyro.conf.subcommand("wheel")]
    | Annotated[CaseCommand, tyro.conf.subcommand("case")]
    | Annotated[CollapseCommand, tyro.conf.subcommand("collapse")]
    | Annotated[CampaignCommand, tyro.conf.subcommand("campaign")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
)


def main(arguments: list[str] | None = None) -> None:
    """Run one command; exits with 2 where its input cannot be, and with 130 after Ctrl-C."""
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    try:
        with terminable():
            parsed(lambda: _parse(arguments))()
    except KeyboardInterrupt:
        console.print("stopped")
        sys.exit(STOPPED)
    except ERRORS as error:
        console.print(f"[red]error:[/red] {escape(said(error))}")
        sys.exit(REFUSED)


def _parse(arguments: list[str] | None) -> Any:
    return tyro.cli(
        Command,
        prog="rftsim-mpm",
        description="The granular continuum by the material point method: reference data for force laws.",
        args=arguments,
        config=(tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
    )
