"""The picture of one run: speed, sinkage, force and power over time."""

from pathlib import Path

from rftsim.run.run import STEADY, History
from rftsim.view.figure import make_figure, save_figure


def plot_history(history: History, title: str, path: Path) -> None:
    """Draw a run's speed, sinkage, force and power over time, and mark its steady state."""
    figure = make_figure((8, 9))
    axes = figure.subplots(4, 1, sharex=True)
    axes[0].plot(history.time, history.speed)
    axes[0].set_ylabel("speed [m/s]")
    axes[1].plot(history.time, 1000 * history.sinkage)
    axes[1].set_ylabel("sinkage [mm]")
    for component, name in enumerate("xyz"):
        axes[2].plot(history.time, history.force[:, component], label=f"F{name}")
    axes[2].set_ylabel("force of the sand [N]")
    axes[2].legend(loc="upper right", ncols=3)
    axes[3].plot(history.time, history.power)
    axes[3].set_ylabel("power of the sand [W]")
    axes[3].set_xlabel("time [s]")
    for axis in axes:
        axis.axvspan(history.time[int(len(history.time) * (1 - STEADY))], history.time[-1], color="0.93", zorder=0)
        axis.grid(alpha=0.3)
    axes[0].set_title(f"{title} (grey: steady state)")
    save_figure(figure, path)
