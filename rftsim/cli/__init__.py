"""The command line `rftsim`: a module for each command."""

from rftsim.cli.main import main
