"""Tests that run in mjlab's own environment, by `make test-mjlab`, and are left out elsewhere."""

import sys
from importlib.util import find_spec
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "docs/examples"
collect_ignore_glob = [] if find_spec("mjlab") else ["test_*.py"]
sys.path.append(str(EXAMPLES))
