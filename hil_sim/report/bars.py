"""The report's charts: success rates as the paper's figure, and closest approaches."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from twinscrew.hil_sim.experiments.plan import SetSettings
from twinscrew.hil_sim.figures import COLOURS, save
from twinscrew.hil_sim.report.material import Material

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

METHOD_COLOURS = (*COLOURS, "#999999")
"""Eight methods, eight colours."""


def draw_success(path: Path, material: Material) -> None:
    """Draw success rates, a group of bars a set, with Wilson's 95 % intervals; PNG and SVG."""
    save(success_figure(material), path)


def success_figure(material: Material) -> Figure:
    """Give the figure of `draw_success`."""
    figure, axes = _canvas(width=10.0)
    width = 0.84 / len(material.methods)
    for k, method in enumerate(material.methods):
        cells = [(i, material.full(method, one)) for i, one in enumerate(material.sets)]
        there = [(i, cell) for i, cell in cells if cell is not None]
        x = np.array([i for i, _ in there]) + (k - 0.5 * (len(material.methods) - 1)) * width
        rate = np.array([100 * cell.success_rate for _, cell in there])
        low = np.array([100 * cell.wilson95[0] for _, cell in there])
        high = np.array([100 * cell.wilson95[1] for _, cell in there])
        error = np.maximum([rate - low, high - rate], 0.0)
        style = {"elinewidth": 0.8, "ecolor": "0.25", "capsize": 1.5}
        colour = METHOD_COLOURS[k % len(METHOD_COLOURS)]
        axes.bar(x, rate, width, label=method, color=colour, yerr=error, error_kw=style)
    axes.set_xticks(range(len(material.sets)), [words(one) for one in material.experiment.sets])
    # A little above 100 %, so that a bar that reaches it shows its interval's end.
    axes.set(ylabel="success rate [%]", ylim=(0, 103), yticks=range(0, 101, 20))
    axes.plot([], [], color="0.25", linewidth=0.8, label="95 % interval (Wilson)")
    axes.grid(axis="y", color="0.92")
    axes.set_axisbelow(True)
    columns = min(len(material.methods) + 1, 5)
    axes.legend(ncols=columns, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
    return figure


def words(one: SetSettings) -> str:
    """Give a set's name as people read it: what is in it, if the set says so."""
    if one.vessels is None or one.buoys is None:
        return one.name
    vessels = f"{one.vessels} vessel{'s' if one.vessels > 1 else ''}"
    buoys = f"{one.buoys or 'no'} buoy{'' if one.buoys == 1 else 's'}"
    return f"{vessels},\n{buoys}"


def draw_closest(path: Path, material: Material) -> None:
    """Draw which share of the vessels came no nearer to anything than a distance."""
    figure, axes = _canvas(width=7.0)
    for k, method in enumerate(material.methods):
        near = sorted(
            vessel.closest_approach_m
            for record in material.records
            if (record.method, record.variant) == (method, material.main)
            for vessel in record.vessels
            if vessel.closest_approach_m is not None
        )
        share = 100 * np.arange(1, len(near) + 1) / max(len(near), 1)
        colour = METHOD_COLOURS[k % len(METHOD_COLOURS)]
        axes.step(near, share, where="post", label=method, color=colour)
    axes.axvline(0.0, color="0.5", linewidth=0.8)
    axes.set(xlabel="closest approach of surfaces [m]", ylabel="vessels [%]", ylim=(0, 100))
    axes.set_xlim(-0.5, 12.0)
    axes.grid(color="0.92")
    axes.set_axisbelow(True)
    axes.legend(frameon=False)
    save(figure, path)


def _canvas(width: float) -> tuple[Figure, Axes]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, 4.2), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.add_subplot()
