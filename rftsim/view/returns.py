"""The picture of how good policies are: the return of each actor on each ground."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from rftsim.view.figure import make_figure, save_figure


class Score(Protocol):
    """The episodes of one actor on one ground, as `plot_returns` draws them."""

    @property
    def ground(self) -> str:
        """The name of the ground that the episodes were on."""
        ...

    @property
    def actor(self) -> str:
        """The name of whoever chose the actions in the episodes."""
        ...

    def mean(self, name: str) -> float:
        """The mean of a number over the episodes; `r` is the return [-]."""
        ...

    def std(self, name: str) -> float:
        """The standard deviation of a number over the episodes."""
        ...


def plot_returns(scores: Mapping[str, Sequence[Score]], path: Path) -> None:
    """Draw the mean return of each actor on each ground, with its standard deviation over the episodes.

    Args:
        scores: The scores in each panel, by the panel's title.
        path: The file of the picture.
    """
    figure = make_figure((9, 1.2 + 3.4 * len(scores)))
    panels = figure.subplots(len(scores), 1, squeeze=False)[:, 0]
    for axis, (title, own) in zip(panels, scores.items(), strict=True):
        grounds = list(dict.fromkeys(one.ground for one in own))
        actors = list(dict.fromkeys(one.actor for one in own))
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
    save_figure(figure, path)
