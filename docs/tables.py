"""Write the tables of the pages: each is what a command prints, kept in a file of docs/tables that a page includes.

python docs/tables.py             # all that take less than a minute each: `make tables`
python docs/tables.py --all       # the dear ones too, an hour or two: a quiet machine is worth waiting for
python docs/tables.py NAME ...    # some: kernel.txt validate-ruts.md; those of policies, which docs/policies.md trains

A text file begins with its command, and a Markdown file ends with it. A table whose command fails stays as it was;
`rftsim validate` ends with 1 where a row fails, which is a result.
"""

import argparse
import os
import shlex
import subprocess
import sys
import time
from pathlib import Path

FOLDER = Path(__file__).parent / "tables"
COLUMNS = "100"
"""Width that the commands print for."""
WARP_CASES = "'heavy sphere' 'rolling wheel' 'legs, broken away' 'edge-on drag' drill re-entry slope weld"
"""Hard cases that the page on Warp shows."""
STUDIES = (
    *("wheel", "runner", "plates", "measured", "scaling", "drill", "continuum"),
    *("motion", "held", "smooth-wheel", "impact", "slope", "ruts"),
)
CHEAP = {
    "help-rftsim.txt": "rftsim --help",
    "help-run.txt": "rftsim run --help",
    "help-rftsim-mpm.txt": "rftsim-mpm --help",
    "inspect-wheel.txt": "rftsim inspect grouser-wheel --law rft3d --set rpm=20",
    "presets.md": "python docs/presets.py",
    "kernel.txt": "rftsim bench kernel",
    "terrain.txt": "rftsim bench terrain",
    "fit-deep.txt": "rftsim fit map mpm/rftsim_mpm/data/deep --dissipative",
    "fit-plates.txt": "rftsim fit map mpm/rftsim_mpm/data/plates --degree 4 --dissipative",
    **{f"validate-{name}.md": f"rftsim validate {name} --markdown" for name in STUDIES},
}
DEAR = {
    "stability.txt": "rftsim bench stability",
    "environment.txt": "rftsim bench environment",
    "solver.txt": "rftsim bench solver",
    "pareto.txt": "rftsim bench pareto --cases laws",
    "tolerance.txt": "rftsim bench pareto --cases tolerance",
    "warp.txt": "rftsim bench warp",
    "warp-cases.txt": f"rftsim bench warp --cases {WARP_CASES}",
}


def _evaluate(*runs: str, more: str = "") -> str:
    """The command that scores policies of docs/policies.md."""
    return f"rftsim evaluate {' '.join(f'out/train/{run}' for run in runs)}{more} --markdown"


_ON_SANDS = " --on 'half as strong,sand,twice as strong,dunes,poppy-seeds,medium-sand'"
_SANDS = "half as strong,twice as strong,dunes,poppy-seeds"
TRAINED = {
    "evaluate-level.md": _evaluate("wheel", "runner", "hexapod", "hopper", more=" --on 'as trained' --baseline"),
    "evaluate-sands.md": _evaluate("wheel-sands", "runner-sands", "hexapod-sands", more=_ON_SANDS),
    "evaluate-sands-robots.md": _evaluate("quadruped-sands", "go1-sands", "rover-sands", more=_ON_SANDS),
    "evaluate-hopper.md": _evaluate("hopper-sands"),
    "evaluate-rover.md": _evaluate("rover-sands"),
    "evaluate-go1.md": _evaluate("go1", more=" --baseline"),
    "evaluate-go1-sands.md": _evaluate("go1-sands"),
    "transfer-hopper.md": _evaluate(
        "hopper-rigid", "hopper", "hopper-sands", more=f" --on 'rigid,sand,{_SANDS},medium-sand'"
    ),
    "transfer-quadruped.md": _evaluate(
        "quadruped-rigid",
        "quadruped-sand",
        "quadruped-sands",
        more=f" --on 'sand,{_SANDS},glass-beads,medium-sand,rigid'",
    ),
}
TABLES = CHEAP | DEAR | TRAINED
RESULTS = (0, 1)
"""Exit codes of a command that has printed its table."""


def write(name: str) -> None:
    """Run a table's command, and keep what it prints in the table's file."""
    command = TABLES[name]
    words = shlex.split(command)
    program = sys.executable if words[0] == "python" else str(Path(sys.executable).parent / words[0])
    done = subprocess.run(
        [program, *words[1:]],
        cwd=FOLDER.parents[1],
        env=os.environ | {"COLUMNS": COLUMNS, "NO_COLOR": "1"},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    if done.returncode not in RESULTS or not done.stdout.strip():
        sys.exit(f"{name}: `{command}` ended with {done.returncode}, and the table stays as it was")
    text = "\n".join(line.rstrip() for line in done.stdout.rstrip().splitlines()) + "\n"
    (FOLDER / name).write_text(text if name.endswith(".md") else f"$ {command}\n{text}")


def main() -> None:
    """Write the tables that are named, or those that are cheap, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"tables: {', '.join(TABLES)}")
    parser.add_argument("--all", action="store_true", help="write the dear ones too")
    asked = parser.parse_args()
    for name in set(asked.names) - set(TABLES):
        parser.error(f"no table {name!r}; tables are {', '.join(TABLES)}")
    for name in asked.names or (CHEAP | DEAR if asked.all else CHEAP):
        began = time.perf_counter()
        write(name)
        print(f"{name}: {TABLES[name]}, {time.perf_counter() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main()
