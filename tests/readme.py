"""Runs README's examples: each block of Python, and the shell lines that name shipped things."""

import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

README = Path(__file__).parent.parent / "README.md"
NEEDS_FILES = re.compile(r"robot\.xml|my_task\.py|out/robot|mesh\.stl|out/train|--data DIR|\.csv")
SHORTENED = {
    "train": "--steps 2048",
    "evaluate": "--episodes 1 --on sand",
    "play": "--seconds 0.2",
    "validate": "plates",
}
"""What makes a command short."""


def main() -> None:
    text = README.read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    if not blocks:
        sys.exit("README has no Python example")
    for block in blocks:
        exec(compile(block, str(README), "exec"), {"__name__": "readme"})
    lines = [line.split("#")[0].strip() for line in re.findall(r"^    (rftsim .*)$", text, flags=re.MULTILINE)]
    runnable = [line for line in lines if not NEEDS_FILES.search(line)]
    if not runnable:
        sys.exit("README has no command that can run as it stands")
    program = Path(sys.executable).absolute().parent / "rftsim"
    with tempfile.TemporaryDirectory() as folder:
        for line in runnable:
            _, command, *rest = shlex.split(line)
            more = SHORTENED.get(command, "").split()
            subprocess.run([program, command, *rest, *more], check=True, cwd=folder)
    print(f"README: {len(blocks)} example and {len(runnable)} command ran")


if __name__ == "__main__":
    main()
