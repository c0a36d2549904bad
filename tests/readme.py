"""Runs README's examples: each block of Python, and the shell lines that name shipped things."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

README = Path(__file__).parent.parent / "README.md"
NEEDS_FILES = re.compile(r"robot\.xml|mesh\.stl")


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
    for line in runnable:
        subprocess.run([Path(sys.executable).parent / "rftsim", *shlex.split(line)[1:]], check=True)
    print(f"README: {len(blocks)} example and {len(runnable)} command ran")


if __name__ == "__main__":
    main()
