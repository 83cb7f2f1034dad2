"""The figure of an identification: measured against predicted, and the thrust curve."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from twinscrew.hil_sim.identification.identify import Identification
from twinscrew.hil_sim.identification.model import STEPS
from twinscrew.hil_sim.identification.recorded import DT_S


def draw(found: Identification, path: Path) -> None:
    """Draw measured against predicted as a PNG file, and an SVG file beside it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = found.shown
    figure = Figure(figsize=(11.0, 7.5), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2)
    steps = np.arange(1, shown.measured.shape[1] + 1) * STEPS * DT_S
    colours = {"measured": "0.2", "identified": "C0", "given": "C1"}
    for axis, column, unit in ((axes[0, 0], 3, "surge [m/s]"), (axes[0, 1], 5, "yaw rate [rad/s]")):
        for name, colour in colours.items():
            rows = getattr(shown, name)[::3, :, column]
            for i, row in enumerate(rows):
                time = shown.time_s[::3][i] + steps
                axis.plot(time, row, color=colour, linewidth=1.2, label=name if i == 0 else None)
        axis.set(xlabel="time [s]", ylabel=unit, title="held out: measured, and predicted for 5 s")
        axis.legend(frameon=False)
    axis = axes[1, 0]
    for row, name in zip(shown.error_m, ("identified", "given"), strict=True):
        axis.plot(steps, row, color=colours[name], label=name)
    axis.axhline(0.1 * found.vessel.length_m, color="0.6", linestyle=":", label="0.1 length")
    axis.set(xlabel="predicted for [s]", ylabel="RMS position error [m]", title="held out")
    axis.legend(frameon=False)
    axis = axes[1, 1]
    axis.fill_between(shown.command, shown.curves[2], shown.curves[3], color="C0", alpha=0.25)
    axis.plot(shown.command, shown.curves[1], color="C0", label="identified, 95 %")
    axis.plot(shown.command, shown.curves[0], color="C1", label="given")
    axis.set(xlabel="command [share of full]", ylabel="thrust of one [N]", title="thrust curve")
    axis.legend(frameon=False)
    for axis in axes.flat:
        axis.grid(color="0.92")
        axis.set_axisbelow(True)
    for suffix in (".png", ".svg"):
        figure.savefig(path.with_suffix(suffix))
