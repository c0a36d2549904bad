"""The notebooks run, from their beginning to their end; the training is a short one."""

import sys
from pathlib import Path

import nbformat
import pytest

DOCS = Path(__file__).parents[1] / "docs"
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))
LARGEST = 1e6
"""Most bytes of all notebooks."""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of Jupyter's own parts
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(monkeypatch, tmp_path, path):
    """A cell that fails raises, and none is silent that showed something before."""
    monkeypatch.syspath_prepend(str(DOCS))
    monkeypatch.setenv("STEPS", "4096")
    monkeypatch.setenv("RUN", str(tmp_path))
    from notebooks import played

    before = nbformat.read(path, as_version=4)
    for old, new in zip(before.cells, played(path).cells, strict=True):
        assert bool(old.get("outputs")) == bool(new.get("outputs"))
    sys.modules.pop("notebooks")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_with_what_it_shows(path):
    """Pictures, no error, and no place of the machine that it ran on."""
    notebook = nbformat.read(path, as_version=4)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any(kind.startswith("image/") for output in outputs for kind in output.get("data", {}))
    assert not any(output.output_type == "error" for output in outputs)
    said = "".join(output.get("text", "") for output in outputs)
    assert "/tmp/" not in said
    assert "/home/" not in said


def test_notebooks_are_small():
    assert sum(path.stat().st_size for path in NOTEBOOKS) < LARGEST
