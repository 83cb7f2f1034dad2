"""Every encounter drawn, six a page, with what both judges say of it: for a mariner to object."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from twinscrew.hil_sim.figures import COLOURS
from twinscrew.hil_sim.rules.compare import RULE_WORDS, Encounter
from twinscrew.hil_sim.rules.evidence import STEP_S, Body, Finding
from twinscrew.runtime.errors import ConfigError, RecordingError
from twinscrew.runtime.messages.types import Float64

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

A_PAGE = 6
BEFORE_S, AFTER_S = 3.0, 3.0
"""[s] What is drawn besides the encounter."""
MARKS_S = 2.0
"""[s] Between two marks on a track; every second one has its time."""
PAGE_IN = (8.27, 11.69)
"""[in] A4."""


def draw_pages(path: Path, encounters: Sequence[Encounter]) -> list[Path]:
    """Draw every encounter into a PDF, or as PNG pages into a folder; give what was written.

    Raises
    ------
    ConfigError
        The path is neither a .pdf nor a folder.
    RecordingError
        It cannot be written.
    """
    if path.suffix and path.suffix.lower() != ".pdf" and not path.is_dir():
        raise ConfigError(f"must be FILE.pdf or a folder, got {path}", key="--pages")
    pages = [encounters[k : k + A_PAGE] for k in range(0, len(encounters), A_PAGE)]
    try:
        if path.suffix.lower() == ".pdf":
            return _as_pdf(path, pages)
        path.mkdir(parents=True, exist_ok=True)
        written = []
        for number, page in enumerate(pages, start=1):
            written.append(path / f"encounters_{number:03d}.png")
            _page(page, number, len(pages)).savefig(written[-1], dpi=110)
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error
    return written


def _as_pdf(path: Path, pages: Sequence[Sequence[Encounter]]) -> list[Path]:
    from matplotlib.backends.backend_pdf import PdfPages

    path.parent.mkdir(parents=True, exist_ok=True)
    with PdfPages(path, metadata={"CreationDate": None}) as pdf:
        for number, page in enumerate(pages, start=1):
            pdf.savefig(_page(page, number, len(pages)))
    return [path]


def _page(encounters: Sequence[Encounter], number: int, pages: int) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=PAGE_IN, layout="constrained")
    FigureCanvasAgg(figure)
    for k, encounter in enumerate(encounters, start=1):
        _draw(figure.add_subplot(3, 2, k), encounter)
    figure.suptitle(
        f"Encounters, page {number} of {pages}: the judged vessel blue, the other red, north up, "
        "metres; numbers are seconds",
        fontsize=8,
    )
    return figure


def _draw(axes: Axes, encounter: Encounter) -> None:
    tracks, one = encounter.case.tracks, encounter.one
    times = tracks.times
    window = (times >= one.begin_s - BEFORE_S) & (times <= one.end_s + AFTER_S)
    for k, body in enumerate(tracks.bodies):
        colour = {one.ego: COLOURS[0], one.other: COLOURS[1]}.get(k, "0.75")
        pose = tracks.pose_N[window, k]
        axes.plot(pose[:, 1], pose[:, 0], color=colour, linewidth=1.0)
        if k in (one.ego, one.other):
            _marks(axes, times[window], pose, colour)
            for at_s in (one.begin_s, one.nearest_s):
                sample = int(np.abs(times - at_s).argmin())
                outline = outline_of(tracks.pose_N[sample, k], body)
                axes.fill(outline[:, 1], outline[:, 0], color=colour, alpha=0.35, linewidth=0.0)
    for north, east, radius in tracks.fixed:
        angle = np.linspace(0.0, 2 * np.pi, 24)
        axes.fill(east + radius * np.cos(angle), north + radius * np.sin(angle), color="0.4")
    _frame(axes, tracks.pose_N[window][:, [one.ego, one.other], :2])
    axes.set_title(_title(encounter), fontsize=5.8, loc="left")


def _marks(axes: Axes, times: Float64, pose: Float64, colour: str) -> None:
    every = round(MARKS_S / STEP_S)
    numbers = np.round(times / STEP_S).astype(int)
    for k in np.flatnonzero(numbers % every == 0).tolist():
        if not np.isfinite(pose[k]).all():
            continue
        axes.plot(pose[k, 1], pose[k, 0], ".", color=colour, markersize=3)
        if numbers[k] % (2 * every) == 0:
            axes.annotate(
                f"{times[k]:.0f}",
                (pose[k, 1], pose[k, 0]),
                fontsize=5,
                color=colour,
                xytext=(2, 2),
                textcoords="offset points",
            )


def _frame(axes: Axes, places: Float64) -> None:
    """Show a square around what the two did."""
    flat = places.reshape(-1, 2)
    flat = flat[np.isfinite(flat).all(axis=1)]
    middle, half = (flat.min(axis=0) + flat.max(axis=0)) / 2, np.ptp(flat, axis=0).max() / 2 + 6.0
    axes.set(xlim=(middle[1] - half, middle[1] + half), ylim=(middle[0] - half, middle[0] + half))
    axes.set_aspect("equal")
    axes.tick_params(labelsize=5)
    axes.grid(color="0.93")
    axes.set_axisbelow(True)


def outline_of(pose: Float64, body: Body) -> Float64:
    """Give a hull seen from above, (n, 2) [m] N: pointed at the bow, or the circle it counts as."""
    if body.circle and body.length_m == body.beam_m:
        angle = np.linspace(0.0, 2 * np.pi, 33)
        return pose[:2] + body.radius_m * np.column_stack([np.cos(angle), np.sin(angle)])
    length, beam = body.length_m / 2, body.beam_m / 2
    ahead = np.array([length, 0.6 * length, -length, -length, 0.6 * length])
    right = np.array([0.0, beam, beam, -beam, -beam])
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return pose[:2] + np.column_stack([c * ahead - s * right, s * ahead + c * right])


def _title(encounter: Encounter) -> str:
    names = [body.name for body in encounter.case.tracks.bodies]
    one = encounter.one
    head = f"{encounter.case.name}\n{names[one.ego]} and {names[one.other]}"
    lines = [
        f"{judge}: {_words(found)}" for judge, found in (("A", encounter.a), ("B", encounter.b))
    ]
    agreed = "" if encounter.agreed else "THE JUDGES DIFFER  "
    return "\n".join(
        [head, *lines, f"{agreed}closest {one.closest_m:.1f} m at {one.nearest_s:.1f} s"]
    )


def _words(found: Finding | None) -> str:
    if found is None:
        return "no encounter"
    verdict = "kept" if found.kept else f"NOT KEPT: {found.why}"
    possible = ", not possible without contact" if found.possible is False else ""
    early = {None: "", True: "; early and readable", False: "; late or small"}[found.readable]
    words = f"rule {found.rule} ({RULE_WORDS[found.rule]}): {verdict}{possible}{early}"
    return textwrap.fill(words, 66)
