"""The command line."""

from rftsim.cli.main import main
