"""MAVProxy, a ground station in use, against a boat that sails: `sitl --ground`.

The boat is simulated; the station, the wire, the runtime and everything that it decides are real.
"""

import re
import signal
from pathlib import Path

import numpy as np
import pytest
from tests.harness.commands import as_json, start, twinscrew
from tests.harness.mavproxy import PROGRAM, MavProxy
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.sitl_runtimes import DATUM
from twinscrew.runtime.charts.chart import as_map
from twinscrew.runtime.datum import to_degrees
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recording import find_recordings

SCENARIO = """
time_limit_s = 300
[[vessel]]
start_m = [8, 27.5]
heading_deg = 0
goal_m = [58, 27.5]
"""
BY_THE_WAY, GOAL = (22.0, 40.0), (58.0, 27.5)
"""[m] [N] A place far off the straight way, and the scenario's goal."""
REEF = (45.0, 50.0)
"""[m] [N] Inside an exclusion fence."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not PROGRAM.is_file(), reason="no MAVProxy: it comes with twinscrew[dev]"),
]


def mission(*places: tuple[float, float]) -> str:
    """Write a mission as ground stations keep it: home first."""
    rows = [(0, *to_degrees(DATUM, (0.0, 0.0))), *((3, *to_degrees(DATUM, p)) for p in places)]
    lines = [
        "\t".join(map(str, (seq, 0, frame, 16, 0, 0, 0, 0, f"{lat:.8f}", f"{lon:.8f}", 0, 1)))
        for seq, (frame, lat, lon) in enumerate(rows)
    ]
    return "\n".join(["QGC WPL 110", *lines, ""])


def fence() -> str:
    """Write a fence as ground stations keep it: a polygon to stay inside of, a circle to avoid."""
    bay = [(5001, 4, place) for place in ((-20.0, 0.0), (90.0, 0.0), (90.0, 60.0), (-20.0, 60.0))]
    items = [*bay, (5004, 6, REEF)]
    lines = ["QGC WPL 110"]
    for seq, (command, size, place) in enumerate(items):
        lat, lon = to_degrees(DATUM, place)
        row = (seq, 0, 3, command, size, 0, 0, 0, f"{lat:.8f}", f"{lon:.8f}", 0, 1)
        lines.append("\t".join(map(str, row)))
    return "\n".join([*lines, ""])


@pytest.fixture(scope="module")
def voyage(tmp_path_factory):
    """One voyage with everything that the station does to the boat; each test looks at a part."""
    folder = tmp_path_factory.mktemp("mavproxy")
    (folder / "far.toml").write_text(SCENARIO)
    (folder / "mission.txt").write_text(mission(BY_THE_WAY, GOAL))
    (folder / "fence.txt").write_text(fence())
    log = folder / "log.txt"
    with MavProxy(folder) as station:
        words = ("--scenario", folder / "far.toml", "--ground", station.address)
        sailing = start("sitl", *words, "--out", folder / "run", log=log)
        try:
            sail(station, folder, log)
            status = sailing.wait(240)
        finally:
            sailing.send_signal(signal.SIGINT)  # it stops its runtimes; nothing if it has ended
            sailing.wait()
        said = station.said
    return folder / "run", said, status, log.read_text()


def sail(station: MavProxy, folder: Path, log: Path) -> None:
    """What somebody at the station does."""
    station.hears("Detected vehicle 1:191")
    station.hears("Received")  # the parameters
    station.type("param show FRAME_CLASS", "FRAME_CLASS      2")
    station.type("set target_component 191", "change target_component 191")
    wait_until(lambda: "under way" in log.read_text())
    station.type(f"wp load {folder / 'mission.txt'}", "MISSION_ACK: TYPE_MISSION: ACCEPTED")
    station.type("wp list", "Saved waypoints")
    station.type("set target_component 1", "change target_component 1")
    station.type("mode HOLD", "Mode HOLD")
    station.look("status SERVO_OUTPUT_RAW", "servo1_raw : 1500, servo2_raw : 0, servo3_raw : 1500")
    station.type("mode MANUAL", "Mode MANUAL")
    station.type("set target_component 191", "change target_component 191")
    station.hears("A waypoint is reached")  # the texts of the component that is spoken to are shown
    lat, lon = to_degrees(DATUM, (30.0, 30.0))
    station.type(f"guided {lat:.7f} {lon:.7f} 0", "DO_REPOSITION: ACCEPTED")
    station.hears("north 30.0 m, east 30.0 m")
    station.type(f"fence load {folder / 'fence.txt'}", "MISSION_ACK: TYPE_FENCE: ACCEPTED")
    lat, lon = to_degrees(DATUM, REEF)
    station.type(f"guided {lat:.7f} {lon:.7f} 0", "goal refused: it is inside an exclusion fence")
    station.type("position 3 0 0", "A new goal was accepted")
    station.type("wp set 2", "A new goal was accepted. (1 in a row")


def test_the_station_sees_autopilot_and_companion_and_reads_the_parameters(voyage) -> None:
    _, said, _, _ = voyage
    assert "Detected vehicle 1:1 " in said
    assert re.search(r"Received \d\d parameters", said)


def test_the_mission_comes_back_as_it_was_uploaded(voyage) -> None:
    _, said, _, _ = voyage
    listed = re.findall(r"^16 (\d) (-?[\d.]+) (-?[\d.]+) .*cur=(\d)", said, re.MULTILINE)
    assert [int(frame) for frame, *_ in listed] == [0, 3, 3]
    lat, lon = to_degrees(DATUM, BY_THE_WAY)
    assert (float(listed[1][1]), float(listed[1][2])) == pytest.approx((lat, lon), abs=1e-7)
    assert [int(current) for *_, current in listed] == [0, 1, 0]


def test_the_boat_sails_by_the_waypoint_to_the_goal(voyage) -> None:
    run, said, status, log = voyage
    assert status == 0, (log, said)
    way = np.array([cdr.decode_odometry(p).position_N[:2] for p in inputs_of(run, "odometry")])
    assert min(np.hypot(*(way - BY_THE_WAY).T)) < 2.0
    assert min(np.hypot(*(way - GOAL).T)) < 2.5  # the last one told before it arrived


def test_the_pilots_change_of_mode_wins_and_manual_gives_the_boat_back(voyage) -> None:
    run, _, _, _ = voyage
    (recording,) = find_recordings(run)
    driving = [cdr.decode_engagement(p).engaged for p in inputs_of(run, "engagement")]
    assert driving[:2] == [True, False]
    assert True in driving[2:]
    told = [
        event.name
        for message in recording.messages(("diagnostics",))
        for event in cdr.decode_diagnostics(message.payload)
    ]
    assert "mode_taken" in told


def test_every_order_is_in_the_recording_and_the_replay_gives_the_same_decisions(voyage) -> None:
    run, _, _, _ = voyage
    routes = [cdr.decode_path(p)[1] for p in inputs_of(run, "route")]
    assert [len(places) for places in routes] == [2, 1]
    assert routes[0] == pytest.approx(np.array([BY_THE_WAY, GOAL]), abs=0.02)
    assert len(inputs_of(run, "goal")) == 3
    assert as_json(twinscrew("replay", run, "--json"))["same"] is True


def test_the_boat_has_the_fence_that_the_station_uploaded(voyage) -> None:
    run, _, _, _ = voyage
    (payload,) = inputs_of(run, "chart")
    chart = as_map(cdr.decode_chart(payload))
    assert chart.why(np.array(REEF)).startswith("inside an exclusion fence")
    assert chart.why(np.array([-30.0, 30.0])).startswith("outside the fence")
    assert not chart.why(np.array(GOAL))


def test_the_station_was_told_in_plain_words(voyage) -> None:
    _, said, _, _ = voyage
    assert "AP: A waypoint is reached; the next one is the goal." in said
    assert "(2 in a row, the last at north 58.0 m, east 27.5 m)" in said  # longer than 50 bytes


def inputs_of(run: Path, topic: str) -> list[bytes]:
    (recording,) = find_recordings(run)
    return [message.payload for message in recording.inputs() if message.topic == topic]
