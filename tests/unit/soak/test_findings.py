"""Each thing that a soak looks for is found."""

from dataclasses import replace
from pathlib import Path

import pytest

from twinscrew.hil_sim.faults.timeline import Span
from twinscrew.hil_sim.faults.verdict import Measured, Verdict
from twinscrew.hil_sim.soak.findings import Finding, as_dict, findings, lives, longest, write
from twinscrew.hil_sim.soak.limits import Sample, load_soak
from twinscrew.hil_sim.soak.vessels import Judged, Missed, VesselSoak

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


BROKEN = verdict(KEPT, replace(KEPT, kept=False))
FINE = VesselSoak(
    name="wamv1",
    samples=samples(),
    faults=(Judged(12.5, verdict(KEPT), ""),),
    decisions=6000,
    missed=Missed(0, in_faults=30, in_standstills=30),
    log="wamv1: running\n",
    recording_mb=50.0,
    turns=8,
)


def found(vessels, standstills=()) -> list[Finding]:
    return findings(vessels, standstills, 600.0, SETTINGS)


def test_a_vessel_that_is_well_is_fine() -> None:
    assert all(finding.fine for finding in found([FINE]))


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
        ({"missed": Missed(7, 0, 0)}, "missed deadlines"),
        ({"log": "Traceback (most recent call last):"}, "unhandled exceptions"),
        ({"log": "thread 'tokio' panicked"}, "unhandled exceptions"),
        ({"faults": (Judged(1.0, BROKEN, ""),)}, "promises kept"),
        ({"faults": (Judged(1.0, BROKEN, "at rest"),)}, "faults judged"),
        ({"recording_mb": 500.0}, "recordings"),
    ],
)
def test_what_is_wrong_is_found_and_nothing_else(change, what: str) -> None:
    assert [finding.what for finding in found([replace(FINE, **change)]) if not finding.fine] == [
        what
    ]


def test_what_grows_while_it_warms_up_is_no_leak() -> None:
    warming = tuple(s._replace(rss_mb=90.0 + min(30.0, 0.3 * s.time_s)) for s in samples())
    assert all(finding.fine for finding in found([replace(FINE, samples=warming)]))


def test_a_killed_runtime_is_several_lives_and_the_longest_counts() -> None:
    killed = replace(
        FINE,
        samples=samples(1, 0.0, 40.0) + samples(2, 40.0, 500.0, 90.0) + samples(3, 540.0, 60.0),
    )
    assert [life[0].pid for life in lives(killed.samples)] == [1, 2, 3]
    assert longest(killed, 0.4).memory_mb_per_h == pytest.approx(90.0)


@pytest.mark.slow
def test_the_report_has_table_figure_and_verdict(tmp_path: Path) -> None:
    bad = replace(FINE, log="Traceback", name="wamv2")
    everything = found([FINE, bad])
    report = as_dict([FINE, bad], everything, 10.0, 3)
    write(tmp_path, [FINE, bad], everything, report)
    text = (tmp_path / "report.md").read_text()
    assert report["fine"] is False
    assert "FAILED" in text
    assert "| wamv2 | unhandled exceptions | none | Traceback | NOT FINE |" in text
    assert "| wamv1 | 12.5 s | lidar_drop | neutral | 0.5 s | 0.40 s | kept |" in text
    assert "| machine | standstills | 1% of 600 s | 0.00 s in 0 | fine |" in text
    assert report["faults"]["wamv1"][0]["at_s"] == 12.5
    assert (tmp_path / "memory.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "report.json").read_text().startswith("{")


def test_the_report_says_why_a_fault_is_not_judged(tmp_path: Path) -> None:
    excused = replace(FINE, faults=(*FINE.faults, Judged(40.0, BROKEN, "at rest")))
    report = as_dict([excused], [], 10.0, 3)
    write(tmp_path, [excused], [], report)
    text = (tmp_path / "report.md").read_text()
    assert "| 40.0 s | lidar_drop | neutral | 0.5 s | 0.40 s | at rest |" in text
    assert [fault["excuse"] for fault in report["faults"]["wamv1"]] == ["", "at rest"]


def test_a_machine_that_stands_still_too_often_measures_nothing() -> None:
    often = [Span(t, t + 0.1) for t in range(100)]
    (bad,) = [finding for finding in found([FINE], often) if not finding.fine]
    assert (bad.vessel, bad.what, bad.found) == ("machine", "standstills", "10.00 s in 100")


def test_a_fault_that_is_excused_breaks_no_promise() -> None:
    faults = (*3 * FINE.faults, Judged(40.0, BROKEN, "at rest"))
    assert all(finding.fine for finding in found([replace(FINE, faults=faults)]))
