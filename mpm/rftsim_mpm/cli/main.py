"""`rftsim-mpm`: every command, and how its errors end."""

import sys
from typing import Annotated, Any

import tyro
from rich.console import Console

from rftsim_mpm.cli.bench import Bench
from rftsim_mpm.cli.campaign import CampaignCommand
from rftsim_mpm.cli.case import CaseCommand
from rftsim_mpm.cli.plate import PlateCommand
from rftsim_mpm.cli.push import PushCommand
from rftsim_mpm.cli.studies import CollapseCommand, DragCommand, WheelCommand
from rftsim_mpm.errors import MpmError

Command = (
    Annotated[PlateCommand, tyro.conf.subcommand("plate")]
    | Annotated[PushCommand, tyro.conf.subcommand("push")]
    | Annotated[DragCommand, tyro.conf.subcommand("drag")]
    | Annotated[WheelCommand, tyro.conf.subcommand("wheel")]
    | Annotated[CaseCommand, tyro.conf.subcommand("case")]
    | Annotated[CollapseCommand, tyro.conf.subcommand("collapse")]
    | Annotated[CampaignCommand, tyro.conf.subcommand("campaign")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
)


def main(arguments: list[str] | None = None) -> None:
    """Run one command; exits with 2 where its input cannot be."""
    try:
        command: Any = tyro.cli(
            Command,
            prog="rftsim-mpm",
            description="The granular continuum by the material point method: reference data for force laws.",
            args=arguments,
            config=(tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
        )
        command()
    except (MpmError, OSError) as error:
        Console(stderr=True).print(f"[red]error:[/red] {error}", highlight=False, soft_wrap=True)
        sys.exit(2)
