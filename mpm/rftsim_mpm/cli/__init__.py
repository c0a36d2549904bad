"""The command line of the continuum."""

from rftsim_mpm.cli.main import main
