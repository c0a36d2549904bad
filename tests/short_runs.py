"""Trainings so short that a test can have one, and the command line as a test calls it."""

from rftsim_envs import tasks

from rftsim.cli import main

TASK = "FourFlapRunner"
SHORT = {"duration": 0.3}
STEPS = tasks.make(TASK, SHORT).config.steps
TINY = {"steps": 500, "n_envs": 4, "n_steps": 32, "batch_size": 32, "n_epochs": 2, "layers": (8,)}


def call(capsys, *arguments):
    """Exit code, standard output and standard error of one command."""
    code = 0
    try:
        main([str(argument) for argument in arguments])
    except SystemExit as end:
        code = end.code
    return code, *capsys.readouterr()
