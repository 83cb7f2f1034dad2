"""REPORT.md: an experiment's results in words, tables and figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from twinscrew.hil_sim.experiments.plan import FULL
from twinscrew.hil_sim.experiments.results import results_sha256
from twinscrew.hil_sim.experiments.runner import count
from twinscrew.hil_sim.experiments.suites import SUITES, counted
from twinscrew.hil_sim.report import bars, gallery, tables
from twinscrew.hil_sim.report.gallery import Picture, Told
from twinscrew.hil_sim.report.markdown import table
from twinscrew.hil_sim.report.material import Conditions, Material, conditions
from twinscrew.hil_sim.sea.sea import SeaSettings
from twinscrew.runtime.errors import RecordingError

FILE = "REPORT.md"
FIGURES = "figures"


def write_report(
    material: Material, failures: int = 8, told: Told | None = None, *, trajectories: bool = True
) -> Path:
    """Write REPORT.md and its figures into the results' folder.

    Parameters
    ----------
    failures
        [-] How many failures to sail again and draw.
    told
        Hears what is being drawn.
    trajectories
        False: nothing is sailed again.

    Raises
    ------
    RecordingError
        The disk is full, or failed.
    """
    folder = material.path / FIGURES
    try:
        folder.mkdir(exist_ok=True)
        bars.draw_success(folder / "success.png", material)
        bars.draw_closest(folder / "closest_approach.png", material)
        pictures = _trajectories(material, folder, told) if trajectories else []
        failed = gallery.failures(material, folder, failures, told) if trajectories else []
        path = material.path / FILE
        path.write_text("\n\n".join(_parts(material, pictures, failed)) + "\n")
    except OSError as error:
        raise RecordingError(f"{material.path}: {error.strerror or error}") from error
    return path


def _trajectories(material: Material, folder: Path, told: Told | None) -> list[Picture]:
    pictures = []
    for name, make in (("open water", gallery.open_water), ("passage", gallery.passage)):
        if told is not None:
            told(name)
        picture = make(material, folder)
        if picture is not None:
            pictures.append(picture)
    return pictures


def _parts(material: Material, pictures: Sequence[Picture], failed: Sequence[Picture]) -> list[str]:
    sailed = conditions(material.experiment)
    parts = ["# Report of an experiment", *_setting(material, sailed)]
    if material.experiment.suite:
        parts += _suite(material)
    parts += ["## Success", SUCCESS, f"![success rates]({FIGURES}/success.png)"]
    parts += [tables.success(material), "Over all sets, and what failed first:"]
    parts += [tables.failures(material), "## Travel time", TRAVEL, tables.travel_time(material)]
    if len(material.methods) > 1:
        parts += ["## Method against method", PAIRED, tables.paired(material)]
    parts += [
        "## Closest approach",
        _closest(sailed),
        f"![closest]({FIGURES}/closest_approach.png)",
    ]
    parts += [tables.closest_approach(material), "## COLREGs", COLREGS, tables.colregs(material)]
    parts += ["## Effort and speed", EFFORT, tables.effort(material)]
    if {tables.UNASSURED, FULL} <= set(material.variants):
        parts += ["## With the assurance and without", ASSURED, tables.assurance(material)]
    if material.trained or len(material.variants) > 1:
        parts += ["## From training to the simulator", GAP, tables.gap(material)]
    if pictures:
        parts += ["## Trajectories", ARROWS, *_shown(pictures)]
    if failed:
        parts += ["## Failures", RERUN, *_shown(failed)]
    return parts


def _setting(material: Material, sailed: Conditions) -> list[str]:
    experiment, folder = material.experiment, material.folder
    there, planned = len(material.records), count(experiment)
    unfinished = "" if there == planned else f" **Unfinished: {planned - there} are missing.**"
    asked = table(
        ["what", "value"],
        [
            ["episodes", f"{there}, {experiment.episodes} a set, method and variant"],
            ["seed", f"{experiment.seed}; each episode's own is in its line"],
            ["sensor", experiment.sensor],
            ["variant that the tables are of", material.main],
            ["results", f"SHA-256 {results_sha256(material.records)[:16]}..."],
            *(["commit, machine", f"{o.commit}; {o.machine}"] for o in folder.origins),
        ],
    )
    methods = [[method.name, f"{method.sha256[:16]}..."] for method in experiment.methods]
    rules = (
        f"{SETTING} In {' or '.join(_sea(sea) for sea in sailed.seas)}. An episode fails if "
        f"anything is touched or a vessel is under way for over {_list(sailed.time_limits_s)} s; "
        f"a vessel has arrived within {_list(sailed.goal_radii_m)} m of its goal."
    )
    return [rules + unfinished, asked, table(["method", "SHA-256 of its policy"], methods)]


def _suite(material: Material) -> list[str]:
    """Give a suite's own section: its question, figures and aims."""
    name = material.experiment.suite
    if name not in SUITES:
        return []
    chosen = [record for record in material.records if record.variant == material.main]
    return [f"## Suite {name}", SUITES[name].about, *tables.suite(list(counted(name, chosen)))]


def _sea(sea: SeaSettings) -> str:
    """Say what a sea is like."""
    wind, waves = sea.wind, sea.waves
    gusts = f" with gusts of {wind.gust_mps:g} m/s" if wind.gust_mps else ""
    blows = f"{wind.mean_mps:g} m/s of wind{gusts}" if wind.mean_mps or gusts else "no wind"
    runs = f"waves of {waves.period_s:g} s and gain {waves.gain:g}" if waves.gain else "flat water"
    speed = math.hypot(*sea.current_mps)
    return f"{blows}, {runs}" + (f" and a current of {speed:g} m/s" if speed else "")


def _closest(sailed: Conditions) -> str:
    buoys = f", buoys' {_list(sailed.buoy_radii_m)} m" if sailed.buoy_radii_m else ""
    return f"{CLOSEST} Surfaces are circles: vessels' of {_list(sailed.hull_radii_m)} m{buoys}."


def _list(values: Sequence[float]) -> str:
    return " or ".join(f"{value:.3g}" for value in values)


def _shown(pictures: Sequence[Picture]) -> list[str]:
    return [
        f"{picture.caption}\n\n![trajectories]({FIGURES}/{picture.file})"
        if picture.file
        else picture.caption
        for picture in pictures
    ]


SETTING = """\
Every vessel of an episode sails by the same method, on the whole runtime: LiDAR, segmentation,
tracking, policy, MAVLink. Every method sails the same episodes."""
SUCCESS = "Share of episodes; in brackets Wilson's 95 % interval [%]."
TRAVEL = """\
Mean over the vessels of the successful episodes; in brackets the 95 % bootstrap interval, whole
episodes resampled. Methods succeed in different episodes: one that fails where it is hard looks
faster than it is. The paper's rows are its table "Travel time data from VRX experiments"."""
PAIRED = """\
On the same episodes of all sets; p: McNemar's exact test, adjusted after Holm for the number of
rows. Later: by how much the second method's vessels arrive later (earlier, if negative) in the
episodes in which both succeed, mean and 95 % bootstrap interval: other than travel times above, a
fair comparison."""
CLOSEST = """\
Least distance between a vessel's surface and anything else's while under way, over all vessels and
sets; below 0 is a collision."""
COLREGS = """\
Encounters by the paper's zones, with the true positions. Asked is: in a head-on one, to leave the
other to port; where the vessel must give way, not to cross ahead; and not to touch. A deviation was
safer if it kept farther off everything than the two would have been by the rules: both turning to
the compliant course in a head-on encounter, the other standing on in a crossing, at their speeds,
with everybody else as they really moved; gained is the median of that difference."""
EFFORT = """\
Energy: the integral of |T| dt over both propellers, mean a vessel in successful episodes.
Decisions: from a scan's bytes to the thrust command's, median of the episodes' (the slowest
vessel's), while the machine did whatever else it did."""
ASSURED = """\
The same episodes with the policy's thrust unchecked, as in the paper, and with the runtime's
assurance in between, as on the boat. An episode fails once, by its first cause."""
GAP = """\
Success rate and mean travel time. Training: `twinscrew evaluate`, with `--on` these very episodes,
with `--all` others of the same kind; its times are of every vessel that arrived. Then the
simulator, the variant of the other tables first; then the same episodes with single differences to
training switched off, and with all of them off at once."""
ARROWS = """\
Outlines every 4 s with the time in seconds; arrows are velocities, 1 m for 1 m/s."""
RERUN = """\
`twinscrew experiment --rerun DIR:LINE --out NEW` sails any of them again, with recordings."""
