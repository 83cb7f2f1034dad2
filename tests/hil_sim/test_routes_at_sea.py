"""Routes in the full simulator: out of a dead end, by learnt walls and by a chart."""

from pathlib import Path

import pytest
from msgspec import structs

from twinscrew.hil_sim import sitl
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlReport, SitlSettings
from twinscrew.runtime.charts.chart import AreaTable, ChartSettings
from twinscrew.runtime.vessel.config import RuntimeConfig

DEAD_END = """
map_size_m = [80.0, 80.0]
sea = "calm"
time_limit_s = 90.0

[[vessel]]
start_m = [30.0, 40.0]
heading_deg = 0.0
goal_m = [75.0, 40.0]

[[quay]]  # across the way
centre_m = [55.0, 40.0]
size_m = [30.0, 3.0, 2.0]
heading_deg = 90.0

[[quay]]
centre_m = [42.0, 25.0]
size_m = [28.0, 3.0, 2.0]

[[quay]]
centre_m = [42.0, 55.0]
size_m = [28.0, 3.0, 2.0]
"""
QUAYS = tuple(
    AreaTable(outline_m=((n0, e0), (n1, e0), (n1, e1), (n0, e1)))
    for n0, e0, n1, e1 in ((53.5, 25, 56.5, 55), (28, 23.5, 56, 26.5), (28, 53.5, 56, 56.5))
)
"""The same as a chart has it."""


def sailed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, **changes: object) -> SitlReport:
    """Sail out of the dead end, with settings that differ."""
    given = sitl.runtime_config

    def config(*args: object) -> RuntimeConfig:
        return structs.replace(given(*args), **changes)  # type: ignore[arg-type]

    monkeypatch.setattr(sitl, "runtime_config", config)
    file = tmp_path / "dead_end.toml"
    file.write_text(DEAD_END)
    return sitl.sail(load_scenario(file), SitlSettings(lockstep=True))


@pytest.mark.slow
def test_a_boat_in_a_dead_end_learns_it_and_sails_out_and_around(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before there were routes it lay before the quay until its time was over."""
    (vessel,) = sailed(tmp_path, monkeypatch).vessels
    assert vessel.outcome == "goal"
    assert vessel.closest_approach_m > 0.0
    assert vessel.travel_time_s < 60.0


@pytest.mark.slow
def test_a_boat_that_knows_its_chart_turns_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    charted = sailed(tmp_path, monkeypatch, chart=ChartSettings(land=QUAYS))
    (vessel,) = charted.vessels
    assert vessel.outcome == "goal"
    assert vessel.closest_approach_m > 0.0
    assert vessel.travel_time_s < 50.0
