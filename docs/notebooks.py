"""Run the notebooks, and keep what they show: `make notebooks`.

python docs/notebooks.py               # all, in place
python docs/notebooks.py NAME ...      # some: fit_your_sand
"""

import sys
from pathlib import Path
from typing import Final

import nbformat
from nbclient import NotebookClient

FOLDER: Final = Path(__file__).parent / "notebooks"
LONGEST: Final = 3600
"""Time that a cell may take [s]."""


def played(path: Path) -> nbformat.NotebookNode:
    """A notebook, run from its beginning in its own folder.

    Args:
        path: The file, *.ipynb.

    Raises:
        CellExecutionError: A cell fails.
    """
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=LONGEST, resources={"metadata": {"path": str(path.parent)}}).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # when it ran, which says nothing
    notebook.metadata.pop("language_info", None)
    return notebook


def main() -> None:
    """Run the notebooks that are named, or all, in place."""
    for name in sys.argv[1:] or [path.stem for path in sorted(FOLDER.glob("*.ipynb"))]:
        path = FOLDER / f"{name}.ipynb"
        nbformat.write(played(path), path)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB", flush=True)


if __name__ == "__main__":
    main()
