"""A picture of a scan: the range image, its objects, and both from above, with tracks and truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twinscrew.runtime.errors import TwinscrewError
from twinscrew.runtime.messages.types import Float64, Objects, PointCloud
from twinscrew.runtime.perception.segmentation import Perception

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = 20
"""[-] Colours of the map tab20, used in turn."""
ARROW_S = 2.0
"""[s] Arrows show where things get in this time."""


def draw(
    perception: Perception,
    cloud: PointCloud,
    objects: Objects,
    file: Path,
    truth: Float64 | None = None,
    tracks: Float64 | None = None,
) -> None:
    """Draw the scan just perceived.

    Parameters
    ----------
    truth, tracks : (T, 5) float64
        Forward, starboard [m], velocity forward, starboard [m/s] and radius [m] of what there is
        and of what is tracked, drawn in the view from above.

    Raises
    ------
    TwinscrewError
        No matplotlib, or a file that cannot be written.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise TwinscrewError("--plot needs matplotlib: pip install 'twinscrew[sim]'") from error
    figure = Figure(figsize=(11, 11), layout="constrained")
    axes = figure.subplots(3, 1, height_ratios=[1, 1, 5])
    _draw_image(axes[0], perception.range_image(), "range image", perception)
    _draw_image(axes[1], perception.object_image(), "objects, each in its colour", perception)
    _draw_points(axes[2], perception, cloud)
    _draw_circles(axes[2], perception, objects, truth, tracks)
    try:
        figure.savefig(file, dpi=90)
    except (OSError, ValueError) as error:
        raise TwinscrewError(f"{file}: {error}") from error


def _draw_image(axes: Axes, image: Any, title: str, perception: Perception) -> None:
    ranges = image.dtype.kind == "f"
    shown = np.ma.masked_where(image <= 0, image) if ranges else _coloured(image)
    sensor = perception.sensor
    first = np.degrees(sensor.first_azimuth)
    last = first + np.degrees(sensor.azimuth_step) * image.shape[1]
    picture = axes.imshow(
        shown,
        vmin=0,
        vmax=perception.settings.max_range_m if ranges else COLOURS - 1,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        cmap="viridis" if ranges else "tab20",
        extent=(first, last, 0, image.shape[0]),
    )
    axes.set(title=title, xlabel="azimuth, clockwise [deg]", ylabel="beam")
    if ranges:
        axes.figure.colorbar(picture, ax=axes, label="range [m]", pad=0.01)


def _coloured(numbers: Any) -> Any:
    """Give each object's colour, as the view from above does."""
    return np.ma.masked_where(numbers < 0, numbers % COLOURS)


def _draw_points(axes: Axes, perception: Perception, cloud: PointCloud) -> None:
    number, used = perception.object_image(), perception.point_image() >= 0
    points_S = cloud.points_S[perception.point_image()[used]]
    p_B = points_S @ perception.sensor.R_BS.T + perception.sensor.mount_position_B
    colour = np.where(number[used] < 0, -1, number[used] % COLOURS)
    free = colour < 0
    axes.scatter(p_B[free, 1], p_B[free, 0], s=1, c="lightgrey")
    axes.scatter(
        p_B[~free, 1], p_B[~free, 0], s=1, c=colour[~free], cmap="tab20", vmin=0, vmax=COLOURS - 1
    )
    axes.plot(0, 0, "k^")


def _draw_circles(
    axes: Axes,
    perception: Perception,
    objects: Objects,
    truth: Float64 | None,
    tracks: Float64 | None,
) -> None:
    """Draw objects, tracks and truth; those that move have an arrow."""
    still = np.zeros((len(objects.p_L), 2))
    seen = np.column_stack([objects.p_L, still, objects.radius])
    _draw_moving(axes, seen, "objects", "black", "-")
    if tracks is not None:
        _draw_moving(axes, tracks, "tracks", "tab:blue", "-")
    if truth is not None:
        _draw_moving(axes, truth, "truth", "red", "--")
    reach = perception.settings.max_range_m
    axes.set(
        xlim=(-reach, reach),
        ylim=(-reach, reach),
        aspect="equal",
        title="from above: echoes in the colour of their object, others grey",
    )
    axes.set(xlabel="starboard [m]", ylabel="forward [m]")
    axes.legend(loc="upper right")


def _draw_moving(axes: Axes, rows: Float64, name: str, colour: str, style: str) -> None:
    from matplotlib.patches import Circle

    for x, y, v_x, v_y, radius in rows:
        axes.add_patch(Circle((y, x), radius, fill=False, color=colour, linestyle=style))
        axes.plot([y, y + ARROW_S * v_y], [x, x + ARROW_S * v_x], color=colour, linestyle=style)
    axes.plot([], [], color=colour, linestyle=style, label=name)
