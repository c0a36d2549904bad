"""The command line as a test calls it."""

from rftsim.cli import main


def call(capsys, *arguments):
    """Exit code, standard output and standard error of one command."""
    code = 0
    try:
        main([str(argument) for argument in arguments])
    except SystemExit as end:
        code = end.code
    return code, *capsys.readouterr()
