"""The trajectory figure: where the vessels went, as the paper draws it.

matplotlib is imported when a figure is drawn, not before: a run does not wait for it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.trajectory import TrajectoryLog
from twinscrew.runtime.messages.types import Float64

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Polygon

HULL_LENGTH_M = 5.0
HULL_WIDTH_M = 2.5
SNAPSHOT_S = 4.0
"""[s] Between two outlines of a vessel."""
MARGIN_M = 3.0
"""[m] Around what is shown."""
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's: told apart by colour-blind people too."""


def outline(north: float, east: float, heading: float) -> Float64:
    """Give the vessel's outline as a polygon, (7, 2) of (east, north) [m], bow pointed."""
    half_l, half_w = HULL_LENGTH_M / 2, HULL_WIDTH_M / 2
    forward = np.array([half_l, 0.6 * half_l, -half_l, -half_l, 0.6 * half_l, half_l, half_l])
    starboard = np.array([0.0, half_w, half_w, -half_w, -half_w, 0.0, 0.0])
    c, s = math.cos(heading), math.sin(heading)
    return np.column_stack(
        [east + s * forward + c * starboard, north + c * forward - s * starboard]
    )


def shown(scenario: Scenario, rows: Float64) -> tuple[Float64, Float64]:
    """Give the corners of a picture, (north, east) [m]: the map, and whatever leaves it.

    A run that never was on the map is shown without it.

    Parameters
    ----------
    scenario
        The episode's beginning.
    rows : (T, V, 7) float64
        Where the vessels were, as `TrajectoryLog.rows`.

    Returns
    -------
    low, high : (2,) float64
        The south-western corner and the north-eastern one.
    """
    size = np.array(scenario.map_size)
    places = np.concatenate(
        [scenario.starts[:, :2], scenario.goals, rows[..., :2].reshape(-1, 2)], dtype=np.float64
    )
    if ((places >= 0.0) & (places <= size)).all(axis=1).any():
        places = np.vstack([places, np.zeros(2), size])
    return places.min(axis=0) - MARGIN_M, places.max(axis=0) + MARGIN_M


def draw_trajectories(
    path: Path,
    scenario: Scenario,
    log: TrajectoryLog,
    outcomes: Sequence[str],
    travel_s: Sequence[float],
) -> None:
    """Draw starts, goals, buoys, tracks, and the vessels with heading and speed at several times.

    Parameters
    ----------
    path
        The PNG file to write.
    scenario
        The episode's beginning.
    log
        Where the vessels were.
    outcomes, travel_s
        What became of each vessel, and when [s].
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 8.0), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    times, rows = log.times, log.rows
    _draw_map(axes, scenario, *shown(scenario, rows))
    for i, name in enumerate(scenario.names):
        colour = COLOURS[i % len(COLOURS)]
        until = times <= travel_s[i] + 1e-6
        _draw_vessel(axes, times[until], rows[until, i], colour)
        label = f"{name}: {outcomes[i]}, {travel_s[i]:.1f} s"
        axes.plot([], [], color=colour, linewidth=2, label=label)
        axes.plot(*scenario.starts[i, 1::-1], "o", color=colour, markersize=7, zorder=4)
        axes.plot(*scenario.goals[i, ::-1], "*", color=colour, markersize=16, zorder=4)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    figure.savefig(path)


def _draw_map(axes: Axes, scenario: Scenario, low: Float64, high: Float64) -> None:
    from matplotlib.patches import Circle

    for north, east, radius in scenario.buoys:
        axes.add_patch(Circle((east, north), radius, color="0.25", zorder=3))
    for quay in scenario.quays:
        axes.add_patch(_quay(quay))
    axes.set(
        xlim=(low[1], high[1]),
        ylim=(low[0], high[0]),
        xlabel="east [m]",
        ylabel="north [m]",
        title=f"{scenario.name}: dots are starts, stars goals, numbers seconds",
        aspect="equal",
    )
    axes.grid(color="0.92")
    axes.set_axisbelow(True)


def _quay(quay: Float64) -> Polygon:
    from matplotlib.patches import Polygon

    north, east, length, width, _, heading = (float(v) for v in quay)
    c, s = math.cos(heading), math.sin(heading)
    ends = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * (length / 2, width / 2)
    corners = [(east + s * f + c * r, north + c * f - s * r) for f, r in ends]
    return Polygon(corners, color="0.6", zorder=2)


def _draw_vessel(axes: Axes, times: Float64, rows: Float64, colour: str) -> None:
    from matplotlib.patches import Polygon

    axes.plot(rows[:, 1], rows[:, 0], color=colour, linewidth=1.2, alpha=0.8)
    if times.size == 0:
        return
    shots = np.searchsorted(times, np.arange(0.0, times[-1] + 1e-9, SNAPSHOT_S))
    for k in np.minimum(shots, times.size - 1):  # the last may be asked for a rounding later
        north, east, heading, v_north, v_east = (float(v) for v in rows[k, :5])
        axes.add_patch(
            Polygon(outline(north, east, heading), facecolor=colour, alpha=0.35, edgecolor=colour)
        )
        axes.annotate(
            "",
            (east + v_east, north + v_north),
            (east, north),
            arrowprops={"arrowstyle": "->", "color": colour},
        )
        axes.annotate(
            f"{times[k]:.1f}", (east, north), (4, 5), textcoords="offset points",
            color=colour, fontsize=7,
        )  # fmt: skip
