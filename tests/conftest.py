"""Settings of the property tests, and a display; being here also puts this folder on the path, for `import oracle`."""

import shutil

import pytest
from displays import virtual_display
from hypothesis import settings

settings.register_profile("rftsim", deadline=None, max_examples=60, derandomize=True, database=None)
settings.load_profile("rftsim")


@pytest.fixture
def display(tmp_path):
    """A virtual display."""
    if shutil.which("Xvfb") is None:
        pytest.skip("there is no Xvfb, a virtual display, on this machine")
    with virtual_display(tmp_path) as made:
        yield made
