import io
import json
import math
from pathlib import Path

from rich.console import Console

from twinscrew.hil_sim.sitl_report import SitlReport, VesselReport
from twinscrew.hil_sim.summary import as_dict, as_table, write_summary
from twinscrew.runtime.vessel.summary import LatencySummary


def vessel(name: str, outcome: str = "goal", closest: float = 3.21049, p99: float = 2.0):
    return VesselReport(
        name=name,
        outcome=outcome,
        travel_time_s=17.94999,
        closest_approach_m=closest,
        decisions=180,
        latency=LatencySummary(180, 0.5, p99, p99, 9.0),
        energy_ns=12345.678,
        sha256=name * 8,
        touched=None,
        greatest_current_mps=0.1234,
    )


def report(*vessels: VesselReport) -> SitlReport:
    return SitlReport(
        success=all(v.outcome == "goal" for v in vessels),
        seed=7,
        vessels=vessels,
        real_time_factor=20.123,
        wall_s=1.234,
    )


def test_the_object_has_the_keys_that_others_script() -> None:
    made = as_dict(report(vessel("wamv1")))
    assert made == {
        "success": True,
        "seed": 7,
        "vessels": [
            {
                "name": "wamv1",
                "outcome": "goal",
                "travel_time_s": 17.95,
                "closest_approach_m": 3.21,
                "decisions": 180,
                "touched": None,
                "greatest_current_mps": 0.123,
            }
        ],
        "latency_ms": {"p50": 0.5, "p99": 2.0, "max": 9.0},
        "real_time_factor": 20.12,
        "decisions_sha256": "wamv1" * 8,
    }


def test_the_latencies_are_those_of_the_slowest_vessel() -> None:
    made = as_dict(report(vessel("a", p99=2.0), vessel("b", p99=5.0)))
    assert made["latency_ms"]["p99"] == 5.0


def test_several_vessels_have_one_hash_that_each_of_them_changes() -> None:
    one, two = report(vessel("a"), vessel("b")), report(vessel("a"), vessel("c"))
    assert len(one.sha256) == 64
    assert one.sha256 != two.sha256


def test_a_vessel_that_met_nobody_has_no_distance_that_json_cannot_hold() -> None:
    made = as_dict(report(vessel("a", closest=math.inf)))
    assert made["vessels"][0]["closest_approach_m"] is None
    assert json.loads(json.dumps(made, allow_nan=False)) == made


def test_the_file_says_more_than_the_object(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    made = report(vessel("a", "collision"))
    write_summary(path, made, {"scenario": "head_on"})
    read = json.loads(path.read_text())
    assert read["setup"] == {"scenario": "head_on"}
    assert read["wall_s"] == 1.23
    assert read["vessels"][0]["energy_ns"] == 12345.7
    assert read["vessels"][0]["latency_ms"] == {"p50": 0.5, "p99": 2.0, "max": 9.0}
    assert {key: read[key] for key in ("success", "seed", "decisions_sha256")} == {
        "success": False, "seed": 7, "decisions_sha256": "a" * 8
    }  # fmt: skip


def test_the_table_has_a_line_a_vessel() -> None:
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(as_table(report(vessel("a"), vessel("b", "timeout", math.inf))))
    text = console.export_text()
    lines = [line for line in text.splitlines() if "ms" in line]
    assert len(lines) == 2
    for word in ("a ", "goal", "17.9 s", "3.21 m", "180", "0.50 ms", "2.00 ms"):
        assert word in lines[0]
    assert "timeout" in lines[1]
    assert " - " in lines[1]
