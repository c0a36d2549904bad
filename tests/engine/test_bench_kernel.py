"""What the kernel's study reports: ratios and counts, which a busy machine leaves alone."""

from pathlib import Path

import pytest

from rftsim.bench import kernel

ORACLE = Path(__file__).parent.parent / "oracle.py"


def test_the_time_of_a_triangle(tmp_path):
    """A law of 159 operations costs more than they take at least; NumPy costs far more; memory is that of 7 columns."""
    limit = kernel.arithmetic()
    small, large = kernel.measure((64, 4096), kernel.load_oracle(ORACLE), lambda _: None)
    assert 100 < limit.operations < 200
    assert 0.3 < large.leading < 0.7
    assert 0.1 < limit.nanoseconds / large.nanoseconds < 1.0 / large.leading
    assert large.ratio > 30
    assert large.nanoseconds < small.nanoseconds
    assert large.memory < 1.05
    assert kernel.load_oracle(tmp_path / "oracle.py") is None


def test_without_the_oracle():
    """The tests' law is not part of the package, so its time may be missing."""
    (cost,) = kernel.measure((64,), None, lambda _: None)
    assert cost.ratio != cost.ratio


@pytest.mark.slow
def test_the_cost_is_linear():
    """Time grows with the number of triangles to a power of 1 within 0.05, from a thousand to a million."""
    costs = kernel.measure((1024, 16384, 131072, 1048576), None, lambda _: None)
    assert kernel.exponent(costs) == pytest.approx(1.0, abs=0.05)
