"""One voyage, with a crew that the test commands: who is told what, and when."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from twinscrew.hil_sim.drivers.realtime import Troubles
from twinscrew.hil_sim.drivers.voyage import ODOMETRY_S, Voyage
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.world import World, make_world
from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, HealthEvent, Odometry
from twinscrew.runtime.safety.events import (
    ARMING_REFUSED,
    AUTOPILOT_NOW,
    AUTOPILOT_RECOVERED,
    INPUT_RECOVERED,
    ODOMETRY_STALE,
)

TWO_VESSELS = """
sea = "calm"
time_limit_s = 6.0
[[vessel]]
start_m = [0.0, 0.0]
heading_deg = 0.0
goal_m = [6.0, 0.0]
[[vessel]]
start_m = [0.0, 30.0]
heading_deg = 0.0
goal_m = [100.0, 30.0]
"""


class Crew:
    """Full ahead from the dock on, and a diary."""

    exchange_s = ODOMETRY_S

    def __init__(self, *, ready_at_s: float = 0.5, fails_at_s: float = np.inf) -> None:
        self.ready_at_s, self.fails_at_s = ready_at_s, fails_at_s
        self.diary: list[tuple[float, int, str, bytes]] = []
        self.retired: list[int] = []
        self.paces: list[float] = []
        self.now_s = 0.0

    def deliver(self, vessel: int, topic: str, payload: bytes, now_s: float) -> None:
        self.diary.append((now_s, vessel, topic, payload))

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        self.now_s = now_s

    def is_ready(self, vessel: int) -> bool:
        return self.now_s >= self.ready_at_s * (1 + vessel)

    def why_not_ready(self, vessel: int) -> str:
        return f"odometry_stale: {vessel}" if self.ready_at_s < 1e3 else ""

    def thrust_N(self) -> Float64:
        return np.full((2, 2), 1000.0)

    def retire(self, vessel: int) -> None:
        self.retired.append(vessel)

    def keep_pace(self, now_s: float) -> None:
        self.paces.append(now_s)

    def check(self) -> None:
        if self.now_s >= self.fails_at_s:
            raise LinkError("the runtime of wamv2 ended with status -9: ")

    def times(self, topic: str, vessel: int) -> list[float]:
        return [t for t, v, name, _ in self.diary if (name, v) == (topic, vessel)]


@pytest.fixture
def world(tmp_path: Path) -> World:
    path = tmp_path / "two.toml"
    path.write_text(TWO_VESSELS)
    return make_world(load_scenario(path), sensor="vrx16", seed=0)


def test_vessels_lie_moored_until_all_autopilots_are_ready_then_all_get_their_goals(
    world: World,
) -> None:
    crew = Crew(ready_at_s=1.0)
    Voyage(world, crew, scan_s=0.1).run()
    assert crew.times("goal", 0) == crew.times("goal", 1)
    (cast_off_s,) = crew.times("goal", 0)
    assert cast_off_s == pytest.approx(2.0, abs=2 * ODOMETRY_S)
    before = [
        cdr.decode_odometry(payload).position_N[0]
        for t, v, topic, payload in crew.diary
        if topic == "odometry" and v == 0 and t <= cast_off_s
    ]
    assert np.ptp(before) < 0.5  # full ahead all the time, but moored
    goals = [cdr.decode_goal(p).position_N.tolist() for _, _, t, p in crew.diary if t == "goal"]
    assert goals == [[6.0, 0.0], [100.0, 30.0]]


def test_odometry_comes_twenty_times_and_scans_ten_times_a_second_in_step(world: World) -> None:
    crew = Crew()
    Voyage(world, crew, scan_s=0.1).run()
    odometry, scans = crew.times("odometry", 1), crew.times("points", 1)
    np.testing.assert_allclose(np.diff(odometry), 0.05, atol=1e-9)
    np.testing.assert_allclose(np.diff(scans), 0.1, atol=1e-9)
    assert set(scans) <= set(odometry)
    topics = [topic for t, v, topic, _ in crew.diary if v == 1 and t == scans[3]]
    assert topics == ["odometry", "points"]  # a scan's odometry is there before it


def test_who_arrives_gets_no_more_messages_and_the_voyage_ends_with_the_last(
    world: World,
) -> None:
    crew = Crew()
    result = Voyage(world, crew, scan_s=0.1).run()
    arrived, late = result.results
    assert (arrived.outcome.value, late.outcome.value) == ("goal", "timeout")
    assert not result.success
    assert crew.retired == [0, 1]
    cast_off_s = crew.times("goal", 0)[0]
    assert max(crew.times("odometry", 0)) - cast_off_s <= arrived.travel_time_s
    assert late.travel_time_s == pytest.approx(6.0, abs=0.1)
    assert result.duration_s == pytest.approx(cast_off_s + 6.0, abs=0.1)


def test_the_log_begins_when_the_vessels_cast_off(world: World) -> None:
    result = Voyage(world, Crew(), scan_s=0.1).run()
    assert result.log.times[0] == 0.0
    assert result.log.times[-1] == pytest.approx(6.0, abs=0.2)
    np.testing.assert_allclose(result.log.rows[0, :, :2], [[0, 0], [0, 30]], atol=0.5)


def test_progress_is_told_while_under_way(world: World) -> None:
    told: list[tuple[float, int]] = []
    Voyage(
        world,
        Crew(),
        scan_s=0.1,
        progress=lambda t, results: told.append((t, len(results))),
    ).run()
    assert [t for t, _ in told] == sorted(t for t, _ in told)
    assert told[-1][0] == pytest.approx(6.0, abs=0.1)
    assert Counter(count for _, count in told).keys() == {2}


def test_an_autopilot_that_is_never_armed_is_named(world: World) -> None:
    crew = Crew(ready_at_s=2.0)
    with pytest.raises(
        LinkError, match=r"not ready to sail after 3 s: wamv2 \(odometry_stale: 1\)$"
    ):
        Voyage(world, crew, scan_s=0.1, dock_limit_s=3.0).run()


def test_a_runtime_that_died_ends_the_voyage(world: World) -> None:
    crew = Crew(fails_at_s=2.0)
    with pytest.raises(LinkError, match="wamv2 ended with status -9"):
        Voyage(world, crew, scan_s=0.1).run()
    assert crew.now_s == pytest.approx(2.0, abs=2 * ODOMETRY_S)


def test_the_pace_is_kept_after_every_exchange(world: World) -> None:
    crew = Crew()
    crew.exchange_s = 0.01
    Voyage(world, crew, scan_s=0.1).run()
    np.testing.assert_allclose(np.diff(crew.paces), 0.01, atol=1e-9)


def test_lingering_keeps_the_vessels_at_the_dock_with_their_goals(world: World) -> None:
    crew = Crew()
    Voyage(world, crew, scan_s=0.1).linger(2.0)
    assert len(crew.times("goal", 0)) == 1
    assert np.abs(world.state.position_N[:, 0]).max() < 0.5


def said(kind, detail: str = "") -> HealthEvent:
    return kind.at(0, detail)


def test_a_refusal_that_is_repeated_is_told_once_and_is_known_at_the_end() -> None:
    troubles = Troubles()
    refusal = said(ARMING_REFUSED, "Arm: Throttle (RC3) is not neutral")
    assert troubles.note(refusal)
    assert not any(troubles.note(refusal) for _ in range(180))
    troubles.note(said(AUTOPILOT_NOW, "MANUAL, disarmed"))
    assert troubles.words == (
        "MANUAL, disarmed; arming_refused: Arm: Throttle (RC3) is not neutral"
    )


def test_what_is_over_is_no_reason_any_more() -> None:
    troubles = Troubles()
    troubles.note(said(AUTOPILOT_NOW, "MANUAL, armed"))
    troubles.note(said(ARMING_REFUSED, "Arm: AHRS"))
    troubles.note(said(ODOMETRY_STALE, "odometry: 0.61 s old, allowed 0.5 s"))
    troubles.note(said(AUTOPILOT_RECOVERED, "arming_refused"))
    assert troubles.words == ("MANUAL, armed; odometry_stale: odometry: 0.61 s old, allowed 0.5 s")
    troubles.note(said(INPUT_RECOVERED, "odometry"))
    assert troubles.words == "MANUAL, armed"
