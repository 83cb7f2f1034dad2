"""The paper's learning-curve figure, from logs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt

from twinscrew.training.curves import learning_curve, logged


def draw_learning_curves(groups: Mapping[str, list[Path]], file: Path) -> None:
    """Draw reward, success and travel time over transitions: mean, and standard error as a band.

    Parameters
    ----------
    groups
        Run directories of several seeds, by the name they are drawn under.
    file
        The picture; its suffix says the format.
    """
    drawn = logged(folder for folders in groups.values() for folder in folders)
    size = (4.5 * len(drawn), 3.8)
    figure, grid = plt.subplots(1, len(drawn), figsize=size, layout="constrained", squeeze=False)
    axes = grid[0]
    for axis, (quantity, label) in zip(axes, drawn.items(), strict=True):
        for name, folders in sorted(groups.items()):
            curve = learning_curve(folders, quantity)
            (line,) = axis.plot(
                curve.transitions / 1e6, curve.mean, label=f"{name} ({curve.seeds} seeds)"
            )
            low, high = curve.mean - curve.error, curve.mean + curve.error
            axis.fill_between(
                curve.transitions / 1e6, low, high, color=line.get_color(), alpha=0.25
            )
        axis.set(xlabel="transitions [million]", ylabel=label)
        axis.grid(alpha=0.3)
    axes[0].legend(title="line: mean, band: standard error")
    figure.savefig(file)
    plt.close(figure)
