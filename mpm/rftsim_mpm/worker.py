"""One job of a campaign, in a process of its own: `python -m rftsim_mpm.worker FOLDER KEY PARENT`."""

import os
import sys
from pathlib import Path

from rftsim_mpm.campaign import compute, key, manifest, write


def main(folder: Path, name: str, parent: int) -> None:
    """Compute and write one result, unless the campaign that wants it dies."""

    def beat() -> None:
        if os.getppid() != parent:
            sys.exit(f"the campaign, process {parent}, is gone")

    job = next(job for job in manifest(folder) if key(job) == name)
    write(folder, name, compute(job, beat))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
