"""The picture of the study of the kernel: the time of a body over its number of triangles."""

from pathlib import Path

import numpy as np

from rftsim.bench.kernel import Arithmetic, Cost
from rftsim.view.figure import make_figure, save_figure


def plot_kernel(costs: list[Cost], limit: Arithmetic, path: Path) -> None:
    """Draw the time of an evaluation against the number of triangles."""
    figure = make_figure((7, 4.5))
    axis = figure.subplots()
    sizes = np.array([cost.triangles for cost in costs])
    axis.loglog(
        sizes, [1e6 * cost.oracle_seconds for cost in costs], "o-", color="C3", label="NumPy, as the paper writes it"
    )
    axis.loglog(sizes, [1e6 * cost.seconds for cost in costs], "o-", color="C0", linewidth=2.5, label="rftsim")
    axis.loglog(sizes, 1e-3 * limit.nanoseconds * sizes, "--", color="0.4", label="arithmetic alone")
    axis.set_xlabel("triangles, all buried")
    axis.set_ylabel("force and moment of a body [µs]")
    axis.grid(alpha=0.3)
    axis.legend()
    save_figure(figure, path)
