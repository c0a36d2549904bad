"""What `--help` shows of each command, and how commands end whose output nobody reads."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from rftsim_mpm.cli import commands as mpm_commands
from rftsim_mpm.cli.main import COMMANDS as MPM

from rftsim.cli import commands
from rftsim.cli.main import COMMANDS

BIN = Path(sys.executable).parent
SCREEN = 48
"""Lines that a command's help takes at most, in a terminal of 80 columns."""


def every(group, words, kind):
    """The words of a program, of each of its commands, and of each group of them."""
    yield words
    for name, one in group.commands.items():
        if isinstance(one, kind):
            yield from every(one, (*words, name), kind)
        else:
            yield (*words, name)


PROGRAMS = {"rftsim": (COMMANDS, commands), "rftsim-mpm": (MPM, mpm_commands)}
ALL = [words for name, (tree, module) in PROGRAMS.items() for words in every(tree, (name,), module.Group)]


def parse(words):
    tree, module = PROGRAMS[words[0]]
    return module.read(words[0], tree, words[1:])


@pytest.mark.parametrize("words", ALL, ids=" ".join)
def test_help_fits_a_screen(capsys, monkeypatch, words):
    """It shows an example that can be given as it stands, no negative beside a flag that is off, and no None."""
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit) as end:
        parse((*words, "--help"))
    said = capsys.readouterr().out
    assert end.value.code in (0, None)
    assert len(said.rstrip().splitlines()) <= SCREEN
    assert "None" not in said
    assert "(default: )" not in said
    assert not re.search(r"--(\S+), --no-\1", said)
    example = re.search(r"Example: (.*?)(; then .*)?\n\s*\n", said, re.DOTALL)
    given = shlex.split(example.group(1))
    assert tuple(given[: len(words)]) == words
    parse(given)


@pytest.mark.parametrize("words", ALL, ids=" ".join)
def test_a_wrong_option_is_one_line(capsys, words):
    module = sys.modules[f"{'rftsim_mpm' if 'mpm' in words[0] else 'rftsim'}.cli.main"]
    with pytest.raises(SystemExit) as end:
        module.main([*words[1:], "--no-such-option", "1"])
    out, err = capsys.readouterr()
    assert end.value.code == 2
    assert out == ""
    assert err.startswith("error: ")
    assert "--help" in err


@pytest.mark.parametrize(
    "words",
    [
        ("rftsim", "--help"),
        ("rftsim", "run", "--help"),
        ("rftsim", "inspect", "grouser-wheel"),
        ("rftsim", "inspect", "grouser-wheel", "--json"),
        ("rftsim-mpm", "--help"),
        ("rftsim-mpm", "campaign", "status", "mpm/rftsim_mpm/data/deep"),
    ],
    ids=" ".join,
)
def test_nobody_reads(words):
    """Where the reader has gone, as `head` goes, nothing is said of it."""
    root = Path(__file__).parents[2]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([BIN / words[0], *words[1:]], cwd=root, **pipes) as program:
        program.stdout.close()
        err = program.stderr.read().decode()
    assert "roken pipe" not in err
    assert "Traceback" not in err
    assert "error" not in err
    assert program.returncode in (1, 141)
