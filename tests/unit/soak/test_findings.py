"""Each thing that a soak looks for is found."""

from dataclasses import replace
from pathlib import Path

import pytest

from twinscrew.hil_sim.faults.verdict import Measured, Verdict
from twinscrew.hil_sim.soak.findings import findings, lives, longest
from twinscrew.hil_sim.soak.report import as_dict, write
from twinscrew.hil_sim.soak.run import VesselSoak
from twinscrew.hil_sim.soak.samples import Sample
from twinscrew.hil_sim.soak.settings import load_soak

SETTINGS = load_soak()
KEPT = Measured(what="neutral", promised="0.5 s", measured="0.40 s", kept=True)


def samples(
    pid: int = 1, begin_s: float = 0.0, seconds: float = 600.0, slope_mb_per_h: float = 0.0
):
    count = round(seconds / 2.0)
    return tuple(
        Sample(begin_s + 2.0 * k, pid, 120.0 + slope_mb_per_h * 2.0 * k / 3600.0, 30, 20)
        for k in range(count)
    )


def verdict(*rows: Measured) -> Verdict:
    return Verdict(name="lidar_drop", fault="scans stop", reaction="neutral", rows=rows)


FINE = VesselSoak(
    name="wamv1",
    samples=samples(),
    verdicts=(verdict(KEPT),),
    decisions=6000,
    missed=0,
    missed_in_faults=3,
    log="wamv1: running\n",
    recording_mb=50.0,
    turns=8,
)


def test_a_vessel_that_is_well_is_fine() -> None:
    assert all(finding.fine for finding in findings([FINE], SETTINGS))


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"samples": samples(slope_mb_per_h=200.0)}, "memory"),
        (
            {"samples": tuple(s._replace(files=30 + k // 20) for k, s in enumerate(samples()))},
            "file handles",
        ),
        (
            {"samples": tuple(s._replace(threads=20 + k // 20) for k, s in enumerate(samples()))},
            "threads",
        ),
        ({"missed": 7}, "missed deadlines"),
        ({"log": "Traceback (most recent call last):"}, "unhandled exceptions"),
        ({"log": "thread 'tokio' panicked"}, "unhandled exceptions"),
        ({"verdicts": (verdict(KEPT, replace(KEPT, kept=False)),)}, "promises kept"),
        ({"recording_mb": 500.0}, "recordings"),
    ],
)
def test_what_is_wrong_is_found_and_nothing_else(change, what: str) -> None:
    found = findings([replace(FINE, **change)], SETTINGS)
    assert [finding.what for finding in found if not finding.fine] == [what]


def test_what_grows_while_it_warms_up_is_no_leak() -> None:
    warming = tuple(s._replace(rss_mb=90.0 + min(30.0, 0.3 * s.time_s)) for s in samples())
    assert all(finding.fine for finding in findings([replace(FINE, samples=warming)], SETTINGS))


def test_a_killed_runtime_is_several_lives_and_the_longest_counts() -> None:
    killed = replace(
        FINE,
        samples=samples(1, 0.0, 40.0) + samples(2, 40.0, 500.0, 90.0) + samples(3, 540.0, 60.0),
    )
    assert [life[0].pid for life in lives(killed.samples)] == [1, 2, 3]
    assert longest(killed, 0.4).memory_mb_per_h == pytest.approx(90.0)


def test_the_report_has_table_figure_and_verdict(tmp_path: Path) -> None:
    bad = replace(FINE, log="Traceback", name="wamv2")
    found = findings([FINE, bad], SETTINGS)
    report = as_dict([FINE, bad], found, 10.0, 3)
    write(tmp_path, [FINE, bad], found, report)
    text = (tmp_path / "report.md").read_text()
    assert report["fine"] is False
    assert "FAILED" in text
    assert "| wamv2 | unhandled exceptions | none | Traceback | NOT FINE |" in text
    assert "| wamv1 | lidar_drop | neutral | 0.5 s | 0.40 s | kept |" in text
    assert (tmp_path / "memory.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "report.json").read_text().startswith("{")
