"""Pictures of runs."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import mujoco
import numpy as np

from rftsim.bench import environment, pareto
from rftsim.bench.kernel import Arithmetic, Cost
from rftsim.bench.stability import FORCES, Row, with_answer
from rftsim.run.rates import Point
from rftsim.run.run import STEADY, History
from rftsim.validation.study import Measured, Study
from rftsim.view.render import render, watching


class Score(Protocol):
    """What `plot_returns` draws."""

    @property
    def ground(self) -> str:
        """Its name."""
        ...

    @property
    def actor(self) -> str:
        """Who acted."""
        ...

    def mean(self, name: str) -> float:
        """Over the episodes."""
        ...

    def std(self, name: str) -> float:
        """Over the episodes."""
        ...


LOST = 10.0
"""Relative error at which a simulation counts as lost in pictures."""


def _figure(size: tuple[float, float]) -> Any:
    from matplotlib.figure import Figure  # not before it is needed: it takes a second

    return Figure(figsize=size, layout="constrained")


def plot_history(history: History, title: str, path: Path) -> None:
    """Draw speed, sinkage, force and power against time."""
    figure = _figure((8, 9))
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
    figure.savefig(path, dpi=110)


def plot_demo(points: list[Point], path: Path) -> None:
    """Draw speed and sinkage against spin, a column per scene, as [Agarwal] Figs. 4-7 and 4-9 do."""
    scenes = list(dict.fromkeys(point.scene for point in points))
    figure = _figure((11, 7.5))
    axes = figure.subplots(2, len(scenes), sharex="col", squeeze=False)
    styles = {"rft2d": ("C0", "--"), "drft2d": ("C0", "-"), "rft3d": ("C1", "--"), "drft3d": ("C1", "-")}
    for column, scene in enumerate(scenes):
        for law, (colour, line) in styles.items():
            own = [point for point in points if point.scene == scene and point.law == law]
            spin = [point.spin for point in own]
            options = {"color": colour, "linestyle": line, "marker": "o", "markersize": 4, "label": law}
            axes[0, column].plot(spin, [point.speed for point in own], **options)
            axes[1, column].plot(spin, [point.sinkage for point in own], **options)
        axes[0, column].set_title(scene)
        axes[0, column].set_ylabel("speed  $v/\\sqrt{g\\ell}$")
        axes[1, column].set_ylabel("sinkage  $z/\\ell$")
        axes[1, column].set_xlabel("spin  $\\omega/\\sqrt{g/\\ell}$")
    for axis in axes.flat:
        axis.grid(alpha=0.3)
        axis.legend()
    figure.suptitle("Wheels on loose poppy seeds: quasi-static (dashed) and dynamic (solid) laws")
    figure.savefig(path, dpi=110)


def save_picture(model: mujoco.MjModel, data: mujoco.MjData, body: str, path: Path) -> None:
    """Render a model, looking at a body, with arrows for the sand's traction."""
    mujoco.mj_forward(model, data)
    camera = watching(model, data, body)
    picture = render(model, data, camera=camera, arrows=camera.distance / 10)
    import matplotlib.image

    matplotlib.image.imsave(path, picture)


def plot_stability(rows: list[Row], path: Path) -> None:
    """Draw the hard cases' error against the time step and against the time spent."""
    figure, answered = _figure((11, 5)), with_answer(rows)
    left, right = figure.subplots(1, 2, sharey=True)
    for force in FORCES if answered else ():
        colour = {"implicit": "C0", "explicit": "C3"}[force]
        steps = sorted({h for row in rows for used, h in row.played if used == force})
        errors = np.array([[row.verdicts[force, h].error for h in steps] for row in answered])
        costs = np.array([[row.played[force, h].cost for h in steps] for row in answered])
        errors = np.clip(errors, 1e-5, LOST)
        left.loglog(1e3 * np.array(steps), errors.T, color=colour, alpha=0.2, linewidth=1)
        left.loglog(1e3 * np.array(steps), np.median(errors, 0), "o-", color=colour, linewidth=2.5, label=force)
        right.loglog(costs.T, errors.T, color=colour, alpha=0.2, linewidth=1)
        middle = np.median(costs, 0), np.median(errors, 0)
        right.loglog(*middle, "o-", color=colour, linewidth=2.5, label=force)
        for h, x, y in zip(steps, *middle, strict=True):
            beside = {"implicit": (-12, -16), "explicit": (0, 8)}[force]
            right.annotate(f"{1e3 * h:g} ms", (x, y), textcoords="offset points", xytext=beside, color=colour)
    left.set_xlabel("time step [ms]")
    left.set_ylabel("error against the exact or converged answer")
    right.set_xlabel("elapsed time per simulated second [s]")
    for axis in (left, right):
        axis.axhline(LOST, color="0.6", linestyle=":")
        axis.grid(alpha=0.3)
        axis.legend(loc="lower right")
    left.text(0.0, LOST, " lost", color="0.4", va="bottom", transform=left.get_yaxis_transform())
    figure.suptitle(f"{len(answered)} hard cases, and their median (bold)")
    figure.savefig(path, dpi=110)


def plot_study(study: Study, measured: Measured, path: Path) -> None:
    """Draw a study of `rftsim validate`."""
    figure = _figure(study.size)
    study.draw(measured, figure)
    figure.savefig(path, dpi=110)


def plot_kernel(costs: list[Cost], limit: Arithmetic, path: Path) -> None:
    """Draw the time of an evaluation against the number of triangles."""
    figure = _figure((7, 4.5))
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
    figure.savefig(path, dpi=110)


def plot_environment(rows: "list[environment.Timed]", path: Path) -> None:
    """Draw what sand costs: the step over the one without sand, and the throughput of batches over it."""
    figure = _figure((11, 4.5))
    left, right = figure.subplots(1, 2)
    cases = list(dict.fromkeys((row.subject, row.law) for row in rows))
    place, colours = np.arange(len(cases)), {"explicit": "C3", "implicit": "C0"}
    for k, (force, colour) in enumerate(colours.items()):
        own = [row for row in rows if row.sand == force]
        limit = environment.LIMITS[own[0].sand]
        left.bar(place + 0.35 * (k - 0.5), [row.ratio for row in own], 0.33, color=colour, label=force)
        left.axhline(limit, color=colour, linestyle="--", linewidth=1)
        right.axhline(1.0 / limit, color=colour, linestyle="--", linewidth=1)
        for j, threads in enumerate(environment.THREADS):
            at, shares = place + 0.18 * (2 * k + j - 1.5), [row.batch[threads][1] for row in own]
            label = f"{force}, {threads} thread{'s' if threads > 1 else ''}"
            right.bar(at, shares, 0.16, color=colour, alpha=1.0 - 0.5 * j, label=label)
    left.set_yscale("log")
    left.set_yticks([1, 2, 3, 5, 10, 20, 30], ["1", "2", "3", "5", "10", "20", "30"])
    left.set_ylabel("step, over that without sand")
    right.set_ylabel(f"throughput of {environment.SIMULATIONS}, over that without sand")
    for axis in (left, right):
        axis.set_xticks(place, [f"{name}\n{law}" for name, law in cases])
        axis.grid(alpha=0.3, axis="y")
        axis.legend()
    figure.suptitle("What sand adds to MuJoCo's step (dashed: what the wheel was asked to keep)")
    figure.savefig(path, dpi=110)


LAWS = {"rft2d": "C9", "drft2d": "C0", "rft3d": "C1", "drft3d": "C3"}
MESHES = {"fine": "s", "shipped": "D", "1 %": "o", "3 %": "v", "10 %": "."}


def plot_pareto(compared: "list[pareto.Compared]", path: Path) -> None:
    """Draw error against cost, a panel per scene, with each law's front."""
    names = list(dict.fromkeys(each.tried[0].subject for each in compared))
    figure = _figure((13, 4.6 * -(-len(names) // 2)))
    panels = figure.subplots(-(-len(names) // 2), 2, squeeze=False).flat
    apart = pareto.apart(compared)
    for axis, name in zip(panels, names, strict=False):
        own = [each for each in compared if each.tried[0].subject == name]
        for each in own:
            _draw_front(axis, each, apart[name, each.tried[0].law])
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.margins(0.12)
        axis.set_title(name)
        axis.set_xlabel("processor time per simulated second [ms]")
        axis.set_ylabel("error of the path [%]")
        axis.grid(alpha=0.3)
        above = axis.secondary_xaxis("top", functions=(_inverse, _inverse))
        above.set_xlabel("times real time")
        _number_plainly(axis.xaxis, axis.yaxis, above.xaxis)
    _explain(figure, [law for law in LAWS if any(each.tried[0].law == law for each in compared)])
    figure.suptitle("Each law against itself with a fine mesh at 0.1 ms; lines: what nothing cheaper comes near")
    figure.savefig(path, dpi=110)


def _number_plainly(*axes: Any) -> None:
    """Numbers at 1, 2 and 5 of each decade of logarithmic axes."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    for axis in axes:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())


def _inverse(x: Any) -> Any:
    return 1e3 / np.maximum(x, 1e-9)


def _draw_front(axis: Any, each: "pareto.Compared", apart: float) -> None:
    colour = LAWS[each.tried[0].law]
    for one in each.tried:
        if one.error < LOST:
            face = colour if one.force == "implicit" else "none"
            options = {"marker": MESHES[one.mesh], "markersize": 5, "linestyle": "", "alpha": 0.4}
            axis.plot(1e3 * one.cost, 100 * max(one.error, 1e-6), color=colour, markerfacecolor=face, **options)
    front = [one for one in pareto.fronts(each.tried) if one.error < LOST]
    axis.plot([1e3 * one.cost for one in front], [100 * one.error for one in front], color=colour, linewidth=2)
    for one in front if apart == 0.0 else ():  # of the scene's own law
        says = f"{1e3 * one.h:g} ms, {one.elements}"
        spot = (1e3 * one.cost, 100 * one.error)
        axis.annotate(says, spot, textcoords="offset points", xytext=(5, 4), fontsize=8, color=colour)
    if apart > 0.0:
        axis.axhline(100 * apart, color=colour, linestyle=":", linewidth=1.5)


def _explain(figure: Any, laws: list[str]) -> None:
    from matplotlib.lines import Line2D

    black: dict[str, Any] = {"color": "0.3", "linestyle": ""}
    lines = [Line2D([], [], color=LAWS[law], linewidth=2, label=law) for law in laws]
    for mesh, marker in MESHES.items():
        says = {"fine": "fine mesh", "shipped": "the model's mesh"}.get(mesh, f"facets, {mesh}")
        lines.append(Line2D([], [], marker=marker, label=says, **black))
    lines.append(Line2D([], [], marker="D", markerfacecolor="none", label="explicit force", **black))
    lines.append(Line2D([], [], color="0.3", linestyle=":", label="the law's distance from the scene's own law"))
    figure.legend(handles=lines, loc="outside lower center", ncols=5)


def plot_returns(scores: "Mapping[str, Sequence[Score]]", path: Path) -> None:
    """Draw the mean return of each actor on each ground, with its standard deviation over the episodes."""
    figure = _figure((9, 1.2 + 3.4 * len(scores)))
    panels = figure.subplots(len(scores), 1, squeeze=False)[:, 0]
    for axis, (title, own) in zip(panels, scores.items(), strict=True):
        grounds, actors = (
            list(dict.fromkeys(names)) for names in zip(*((s.ground, s.actor) for s in own), strict=True)
        )
        for k, actor in enumerate(actors):
            drawn = [one for one in own if one.actor == actor]
            places = [grounds.index(one.ground) + 0.2 * (k - 0.5 * (len(actors) - 1)) for one in drawn]
            means, stds = [one.mean("r") for one in drawn], [one.std("r") for one in drawn]
            axis.errorbar(places, means, stds, fmt="o", color=f"C{k}", capsize=3, label=actor)
        axis.set_xticks(range(len(grounds)), grounds, rotation=25, ha="right")
        axis.set_ylabel("return per episode [-]")
        axis.set_title(title)
        axis.axhline(0.0, color="0.7", linewidth=0.8)
        axis.grid(alpha=0.3)
        axis.legend()
    panels[-1].set_xlabel("ground")
    figure.suptitle("Mean and standard deviation over the episodes")
    figure.savefig(path, dpi=110)
