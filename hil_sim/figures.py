"""The trajectory figure: where the vessels went, as the paper draws it; and how figures are saved.

matplotlib is imported when a figure is drawn, not before: a run does not wait for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.traffic import Traffic
from twinscrew.hil_sim.trajectory import TrajectoryLog
from twinscrew.runtime.messages.types import Float64

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon

HULL_LENGTH_M = 5.0
HULL_WIDTH_M = 2.5
SNAPSHOT_S = 4.0
"""[s] Between two outlines of a vessel: a whole number, which is written beside it."""
APART_M = 3.0
"""[m] An outline nearer to another one of its vessel is left out: where a boat loiters they would
be a blot."""
REACHES = (1.0, 1.3, 1.7, 2.2, 3.0, 4.0)
"""[-] How far from an outline its number may be written, in half outlines."""
AXES_IN = 5.3
"""[in] Width of the map."""
LABEL_PT = 7.0
"""[pt] Size of the numbers."""
MARGIN_M = 3.0
"""[m] Around what is shown."""
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's: told apart by colour-blind people too."""
OUTCOMES = {
    "goal": "arrived after",
    "collision": "collided after",
    "fence": "entered a fence after",
    "timeout": "out of time after",
    "done": "trial done after",
    "ended": "trial ended early after",
}


FLOW_ARROWS = 12
"""[-] Arrows of the current along the longer side of the map."""
_CLOSED = {"fill": False, "hatch": "////", "edgecolor": "#c2186b", "linewidth": 0.8, "alpha": 0.6}
REGIONS: dict[str, tuple[dict[str, Any], str]] = {
    "land": ({"facecolor": "#d8cbaa", "edgecolor": "0.35", "linewidth": 0.8}, "land"),
    "keep_out": (_CLOSED, "keep-out area"),
    "depth": ({"facecolor": "#bfe0ea", "edgecolor": "#4f93a8", "linewidth": 0.6}, "shallow"),
    "hazard": ({"facecolor": "#555555", "hatch": "xx", "edgecolor": "0.2"}, "hazard"),
    "fence": (
        {"fill": False, "edgecolor": "#c2186b", "linestyle": "--", "linewidth": 1.4},
        "fence",
    ),
}
"""How what is charted is drawn, and what it is called."""


def save(figure: Figure, path: Path) -> None:
    """Save a figure as PNG, and as SVG beside it: the one to look at, the other to print.

    The same figure gives the same files.
    """
    from matplotlib import rc_context

    figure.savefig(path)
    with rc_context({"svg.hashsalt": path.stem}):
        figure.savefig(path.with_suffix(".svg"), metadata={"Date": None})


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
        Where the vessels were, as `TrajectoryLog.rows`; the arrows of their velocities count too.

    Returns
    -------
    low, high : (2,) float64
        The south-western corner and the north-eastern one.
    """
    size = np.array(scenario.map_size)
    tips = rows[..., :2] + rows[..., 3:5]
    places = np.concatenate(
        [
            scenario.starts[:, :2],
            scenario.goals,
            rows[..., :2].reshape(-1, 2),
            tips.reshape(-1, 2),
        ],
        dtype=np.float64,
    )
    if ((places >= 0.0) & (places <= size)).all(axis=1).any():
        places = np.vstack([places, np.zeros(2), size])
    return places.min(axis=0) - MARGIN_M, places.max(axis=0) + MARGIN_M


def snapshots(times: Float64, rows: Float64) -> Iterator[tuple[int, float]]:
    """Choose when a vessel's outline is drawn.

    Parameters
    ----------
    times : (T,) float64
        [s] Rising.
    rows : (T, 7) float64
        Where the vessel was.

    Yields
    ------
    row, time_s
        Every `SNAPSHOT_S` the row nearest to that time, unless an outline was drawn there before.
    """
    if times.size == 0:
        return
    drawn = np.empty((0, 2))
    for time_s in np.arange(0.0, times[-1] + 1e-6, SNAPSHOT_S):
        row = int(np.argmin(np.abs(times - time_s)))
        place = rows[row, :2]
        if not len(drawn) or np.hypot(*(place - drawn).T).min() >= APART_M:
            drawn = np.vstack([drawn, place])
            yield row, float(time_s)


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
        The PNG file to write; an SVG file is written beside it.
    scenario
        The episode's beginning.
    log
        Where the vessels were.
    outcomes, travel_s
        What became of each vessel, and when [s].
    """
    save(trajectory_figure(scenario, log, outcomes, travel_s), path)


def trajectory_figure(
    scenario: Scenario, log: TrajectoryLog, outcomes: Sequence[str], travel_s: Sequence[float]
) -> Figure:
    """Give the figure of `draw_trajectories`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    times, rows = log.times, log.rows
    under_way = [times <= end_s + 1e-6 for end_s in travel_s]
    sailed = np.concatenate([rows[until, i] for i, until in enumerate(under_way)])
    low, high = shown(scenario, sailed[:, None])
    tall, wide = high - low
    # Placed by hand: matplotlib's own layouts need several drawings until they have settled.
    height = min(max(AXES_IN * tall / wide, 3.0), 9.0)
    size = np.array([AXES_IN + 3.5, height + 0.95])
    figure = Figure(figsize=tuple(size), dpi=130)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.7 / size[0], 0.55 / size[1], AXES_IN / size[0], height / size[1]))
    _draw_map(axes, scenario, low, high)
    labels: list[_Label] = []
    for i, name in enumerate(scenario.names):
        colour = COLOURS[i % len(COLOURS)]
        labels += _draw_vessel(axes, times[under_way[i]], rows[under_way[i], i], colour)
        words = f"{name}: {OUTCOMES.get(outcomes[i], outcomes[i])} {travel_s[i]:.1f} s"
        axes.plot([], [], color=colour, linewidth=2, label=words)
        axes.plot(*scenario.starts[i, 1::-1], "o", color=colour, markersize=7, zorder=4)
        axes.plot(*scenario.goals[i, ::-1], "*", color=colour, markersize=13, zorder=4)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=9)
    axes.apply_aspect()  # the axes have their place now
    _write(axes, labels)
    return figure


_Label = tuple[float, Float64, str]
"""A time [s], the outline that it is of, (7, 2) [m], and its colour."""


def _draw_map(axes: Axes, scenario: Scenario, low: Float64, high: Float64) -> None:
    from matplotlib.patches import Circle

    _draw_regions(axes, scenario)
    for north, east, radius in scenario.circles:
        axes.add_patch(Circle((east, north), radius, color="0.25", zorder=3))
    for quay in scenario.quays:
        axes.add_patch(_quay(quay))
    for box in Traffic(scenario.traffic).boxes:
        axes.add_patch(_quay(box))
    for i, (north, east) in enumerate(scenario.goals):
        colour = COLOURS[i % len(COLOURS)]
        style = {"fill": False, "color": colour, "linestyle": ":", "linewidth": 0.9}
        axes.add_patch(Circle((east, north), scenario.goal_radius, **style))
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


FLOW_S = 4.0
"""[s] Arrows of the current are as long as it flows in this time."""


def _draw_regions(axes: Axes, scenario: Scenario) -> None:
    """Draw land, what is charted, and the current when the run begins."""
    from matplotlib.patches import Polygon

    named: set[str] = set()
    for outline in scenario.outlines:
        shut = outline.kind == "fence" and not outline.keep_in
        style, words = REGIONS["keep_out" if shut else outline.kind]
        label = "_" if words in named else words
        named.add(words)
        axes.add_patch(Polygon(outline.ring[:, ::-1], zorder=1.5, label=label, **style))
    flow = scenario.flow(FLOW_ARROWS)
    if len(flow):
        north, east, v_north, v_east = flow.T
        fastest = float(np.hypot(v_north, v_east).max())
        axes.quiver(
            east,
            north,
            v_east,
            v_north,
            color="#7aa6c2",
            width=0.003,
            angles="xy",
            scale_units="xy",
            scale=1.0 / FLOW_S,
            zorder=1.2,
            label=f"current at first, up to {fastest:.1f} m/s",
        )


def _quay(quay: Float64) -> Polygon:
    from matplotlib.patches import Polygon

    north, east, length, width, _, heading = (float(v) for v in quay)
    c, s = math.cos(heading), math.sin(heading)
    ends = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * (length / 2, width / 2)
    corners = [(east + s * f + c * r, north + c * f - s * r) for f, r in ends]
    return Polygon(corners, color="0.6", zorder=2)


def _draw_vessel(axes: Axes, times: Float64, rows: Float64, colour: str) -> list[_Label]:
    from matplotlib.patches import Polygon

    axes.plot(rows[:, 1], rows[:, 0], color=colour, linewidth=1.2, alpha=0.8)
    labels = []
    for k, time_s in snapshots(times, rows):
        north, east, heading, v_north, v_east = (float(v) for v in rows[k, :5])
        hull = outline(north, east, heading)
        axes.add_patch(Polygon(hull, facecolor=colour, alpha=0.35, edgecolor=colour))
        axes.annotate(
            "",
            (east + v_east, north + v_north),
            (east, north),
            arrowprops={"arrowstyle": "->", "color": colour},
        )
        labels.append((time_s, hull, colour))
    return labels


def _write(axes: Axes, labels: Sequence[_Label]) -> None:
    """Write the times beside their outlines, where they lie on no outline and no other time."""
    to_pixels = axes.transData.transform
    to_metres = axes.transData.inverted().transform
    points = axes.get_figure(root=True).dpi / 72.0  # type: ignore[union-attr]
    within = np.array(axes.bbox.extents)
    hulls = np.array([_box(to_pixels(hull)) for _, hull, _ in labels]).reshape(-1, 4)
    written = np.empty((0, 4))
    for (time_s, _, colour), hull in zip(labels, hulls, strict=True):
        words = f"{time_s:g}"
        size = np.array([0.64 * len(words), 1.0]) * LABEL_PT * points
        box = _free_place(hull, size, hulls, written, within)
        written = np.vstack([written, box])
        east, north = to_metres(box[:2])
        axes.text(east, north, words, color=colour, fontsize=LABEL_PT, va="bottom")


def _free_place(
    hull: Float64, size: Float64, hulls: Float64, written: Float64, within: Float64
) -> Float64:
    """Give the box of a text as near to a hull as there is room; boxes are (x0, y0, x1, y1) [px].

    Parameters
    ----------
    hull : (4,) float64
        The box that the text belongs to.
    size : (2,) float64
        The text's.
    hulls, written : (K, 4) float64
        What it should not lie on: outlines, and above all, other texts.
    within : (4,) float64
        Where it must lie.
    """
    centre, reach = (hull[:2] + hull[2:]) / 2, (hull[2:] - hull[:2]) / 2
    angles = np.arange(16) * math.pi / 8 + math.pi / 4
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    further = np.repeat(REACHES, len(ways))[:, None]
    middles = centre + further * np.tile(ways, (len(REACHES), 1)) * (reach + 0.6 * size)
    boxes = np.hstack([middles - 0.5 * size, middles + 0.5 * size])
    covered = _covered(boxes, hulls) + 100.0 * _covered(boxes, written)
    outside = (boxes[:, :2] < within[:2]).any(axis=1) | (boxes[:, 2:] > within[2:]).any(axis=1)
    best: Float64 = boxes[int(np.argmin(covered + 1e9 * outside))]  # the first of equals is nearest
    return best


def _covered(boxes: Float64, others: Float64) -> Float64:
    """Give how much of each box the others lie on [px^2]."""
    low = np.maximum(boxes[:, None, :2], others[:, :2])
    common = np.minimum(boxes[:, None, 2:], others[:, 2:]) - low
    area: Float64 = np.maximum(common, 0.0).prod(axis=2).sum(axis=1)
    return area


def _box(points: Float64) -> Float64:
    return np.concatenate([points.min(axis=0), points.max(axis=0)])
