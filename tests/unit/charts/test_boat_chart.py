"""A boat with a chart: goals that it forbids, the recording, what is said."""

import json
import socket
import threading
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tests.harness.boat import feed, odometry, stamp
from tests.harness.commands import twinscrew
from tests.unit.charts.test_geojson import DATUM, SQUARE, collection, feature, lon_lat, ring

from twinscrew.runtime.bus.base import Inbox
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.charts.chart import as_map, as_message
from twinscrew.runtime.charts.static_map import Area, Disc, StaticMap
from twinscrew.runtime.doctor.checks import Verdict, check_chart
from twinscrew.runtime.errors import ConfigError, MessageError
from twinscrew.runtime.ground.orders import GoalFrames
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Goal
from twinscrew.runtime.vessel.approval import files_of
from twinscrew.runtime.vessel.config import config_for, load_config
from twinscrew.runtime.vessel.vessel import make_vessel, vessel_for_replay

LAND = {"outline_m": SQUARE, "name": "Mole"}
BAY = Area(kind="fence", outline=np.array([[-50.0, -50], [90, -50], [90, 90], [-50, 90]]),
           keep_in=True, name="bay")  # fmt: skip


def vessel_with(**chart):
    return make_vessel(config_for("wam_v", policy="apf", chart=chart))


def goal(north, east, at_s=1.0):
    place = Goal(stamp_ns=stamp(at_s), position_N=np.array([north, east]))
    return cdr.encode_goal(place, frame_id="")


def events(out, name):
    return [event.detail for event in out.events if event.name == name]


def test_the_message_of_a_map_holds_all_of_it():
    chart = StaticMap.of(
        [
            Area(kind="land", outline=np.array(SQUARE), holes=(np.array(SQUARE) / 4 + 5.0,)),
            Area(kind="depth", outline=np.array(SQUARE) + 99.0, depth_m=3.5, name="Reede"),
            Disc(kind="hazard", centre=(1.0, 200.0), radius_m=2.5, name="Stein"),
            BAY,
        ],
        safety_depth_m=1.5,
    )
    again = as_map(cdr.decode_chart(cdr.encode_chart(as_message(chart, 7))))
    assert again.version == chart.version
    assert len(again.features) == 4
    np.testing.assert_array_equal(again.edges, chart.edges)


def test_bytes_that_are_no_map_are_a_message_error():
    payload = cdr.encode_chart(as_message(StaticMap.of([BAY]), 7))
    tie = np.array([[0.0, 0], [10, 10], [10, 0], [0, 10]])
    crossing = as_message(StaticMap((Area(kind="land", outline=tie),), 0.0), 7)
    for broken in (payload[:-9], payload[:30], payload + bytes(9)):
        with pytest.raises(MessageError):
            cdr.decode_chart(broken)
    with pytest.raises(MessageError, match="crosses itself"):
        as_map(crossing)


def test_a_goal_on_land_is_not_taken_and_the_one_before_stays():
    vessel = vessel_with(land=[LAND])
    feed(vessel, "odometry", cdr.encode_odometry(odometry(1.0, north=-20.0)), 1.0)
    feed(vessel, "goal", goal(-20.0, 30.0), 1.0)
    out = feed(vessel, "goal", goal(20.0, 15.0), 1.1)
    assert events(out, "goal_forbidden") == [
        "not taken: the goal, north 20.0 m, east 15.0 m, is on land (Mole)"
    ]
    assert vessel.pipeline.mission.goal.position_N.tolist() == [-20.0, 30.0]


def test_a_route_with_a_place_in_shallow_water_is_not_taken():
    shoal = {"outline_m": SQUARE, "depth_m": 0.4}
    vessel = vessel_with(depth=[shoal], safety_depth_m=1.0)
    feed(vessel, "odometry", cdr.encode_odometry(odometry(1.0, north=-20.0)), 1.0)
    path = cdr.encode_path(np.array([[-9.0, 0.0], [20.0, 15.0]]), stamp_ns=stamp(1.0), frame_id="")
    out = feed(vessel, "route", path, 1.0)
    (words,) = events(out, "goal_forbidden")
    assert "goal 2 of 2" in words
    assert "in water shallower than 1 m" in words
    assert vessel.pipeline.mission.goal is None


def test_a_goal_that_came_before_any_odometry_is_taken_back_if_it_is_on_land():
    vessel = vessel_with(land=[LAND])
    assert not events(feed(vessel, "goal", goal(20.0, 15.0), 1.0), "goal_forbidden")
    out = feed(vessel, "odometry", cdr.encode_odometry(odometry(1.0, north=-20.0)), 1.1)
    (words,) = events(out, "goal_forbidden")
    assert words.startswith("taken back: the goal")
    assert vessel.pipeline.mission.goal is None


def test_a_berth_that_came_before_any_odometry_stays_though_its_face_is_the_quays_edge():
    vessel = vessel_with(land=[LAND])
    face = np.array([[0.0, 25.0], [0.0, 5.0]])
    feed(vessel, "berth", cdr.encode_path(face, stamp_ns=stamp(1.0), frame_id=""), 1.0)
    out = feed(vessel, "odometry", cdr.encode_odometry(odometry(1.0, north=-20.0)), 1.1)
    assert not events(out, "goal_forbidden")
    assert vessel.pipeline.mission.berth is not None
    assert not vessel.fence("station", (Disc(kind="fence", centre=(90.0, 0.0), radius_m=5.0),))
    feed(vessel, "odometry", cdr.encode_odometry(odometry(1.1, north=-20.0)), 1.2)
    assert vessel.pipeline.mission.berth is not None
    assert not vessel.fence("station", (Disc(kind="fence", centre=(-20.0, 15.0), radius_m=40.0),))
    out = feed(vessel, "odometry", cdr.encode_odometry(odometry(1.2, north=-20.0)), 1.3)
    assert events(out, "goal_forbidden")
    assert vessel.pipeline.mission.berth is None


def test_the_safety_depth_follows_the_draught_if_it_is_not_set():
    shoal = {"outline_m": SQUARE, "depth_m": 0.7}
    for hull, forbidden in (("wam_v", True), ("blueboat", False)):
        vessel = make_vessel(config_for(hull, policy="apf", chart={"depth": [shoal]}))
        vessel.tick(0.0)
        assert vessel.chart.forbidden(np.array([[20.0, 15.0]]))[0] == forbidden, hull


def test_a_fence_takes_back_goals_beyond_it_and_names_a_boat_outside_of_it():
    vessel = vessel_with()
    feed(vessel, "odometry", cdr.encode_odometry(odometry(1.0, north=-60.0)), 1.0)
    feed(vessel, "goal", goal(100.0, 0.0), 1.0)
    assert vessel.fence("station", (BAY,)) == ""
    out = vessel.tick(1.1)
    assert events(out, "chart_changed") == ["1 fence"]
    (words,) = events(out, "goal_forbidden")
    assert words.startswith("taken back: the goal, north 100.0 m")
    assert "outside the fence (bay)" in events(out, "place_forbidden")[0]
    assert vessel.pipeline.mission.goal is None
    vessel.fence("station", ())
    vessel.tick(1.2)
    assert vessel.chart.is_empty


def test_fences_that_leave_no_water_are_refused_and_those_before_stay():
    vessel = vessel_with()
    vessel.fence("autopilot", (BAY,))
    far = Disc(kind="fence", centre=(1000.0, 0.0), radius_m=10.0, keep_in=True)
    assert "leave no water" in vessel.fence("station", (far,))
    vessel.tick(1.0)
    assert not vessel.chart.forbidden(np.array([[0.0, 0.0]]))[0]


def test_a_replay_has_the_same_map_and_refuses_the_same_goals():
    vessel = vessel_with(land=[LAND])
    taken = list(vessel.tick(0.0).messages)
    here = cdr.encode_odometry(odometry(1.0, north=-20.0))
    taken += feed(vessel, "odometry", here, 1.0).messages
    taken += feed(vessel, "goal", goal(-20.0, 30.0), 1.0).messages
    vessel.fence("autopilot", (BAY,))
    taken += vessel.tick(1.1).messages
    taken += feed(vessel, "goal", goal(200.0, 30.0), 1.2).messages
    assert [t.topic for t in taken if t.topic == "chart"] == ["chart", "chart"]
    again = vessel_for_replay(config_for("wam_v", policy="apf"), has_chart=True)
    for message in taken:
        feed(again, message.topic, message.payload, 0.0)
    assert again.chart.version == vessel.chart.version
    assert again.pipeline.mission.goal.position_N.tolist() == [-20.0, 30.0]


def test_a_goal_of_the_configuration_on_land_is_refused_at_the_start():
    config = config_for(
        "wam_v", policy="apf", chart={"land": [LAND]}, mission={"waypoints_m": [[20.0, 15.0]]}
    )
    with pytest.raises(ConfigError, match=r"mission.waypoints_m\[0\]: .* is on land \(Mole\)"):
        make_vessel(config)


@pytest.mark.parametrize(
    ("place", "words"),
    [((20.0, 15.0), "it is on land (Mole)"), ((500.0, 0.0), "it is outside the fence (bay)")],
)
def test_a_station_that_asks_for_a_forbidden_place_is_denied_and_told_why(place, words):
    land = Area(kind="land", outline=np.array(SQUARE), name="Mole")
    frames = GoalFrames(None, 5000.0, StaticMap.of([land, BAY]))
    fault = frames.place(int(mavlink.MAV_FRAME_LOCAL_NED), *place)
    assert (fault.result, fault.words) == (mavlink.MAV_MISSION_DENIED, words)


def test_the_doctor_reports_what_the_chart_forbids(tmp_path):
    found = check_chart(load_config(write(tmp_path, DATUM_TOML)))
    assert found.verdict is Verdict.WARN  # the square's corner is the datum
    assert "1 land; 4 edges, safety depth 0.8" in found.found
    assert "the origin of frame N is on land" in found.found
    assert check_chart(config_for("wam_v")).verdict is Verdict.OK


def write(folder: Path, text: str, **more) -> Path:
    root = collection(feature("Polygon", [ring(SQUARE)], twinscrew="land"), **more)
    (folder / "map.geojson").write_text(json.dumps(root))
    config = folder / "boat.toml"
    config.write_text(f'policy = "apf"\n{text}[chart]\nfile = "{folder}/map.geojson"\n')
    return config


DATUM_TOML = f"""[autopilot.datum]
latitude_deg = {DATUM.latitude_deg}
longitude_deg = {DATUM.longitude_deg}
"""


def test_a_charts_file_is_read_with_the_datum_and_is_among_the_approved_files(tmp_path):
    source = write(tmp_path, DATUM_TOML)
    config = load_config(source)
    vessel = make_vessel(config)
    vessel.tick(0.0)
    assert vessel.chart.why(np.array([20.0, 15.0])) == "on land"
    assert tmp_path / "map.geojson" in files_of(source, config)


def test_a_chart_without_a_datum_or_too_large_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"chart\.file needs"):
        load_config(write(tmp_path, ""))
    config = load_config(write(tmp_path, DATUM_TOML))
    with (tmp_path / "map.geojson").open("r+b") as file:
        file.truncate(200_000_000)
    with pytest.raises(ConfigError, match=r"chart.file: .*more than 16 MB.*twinscrew chart import"):
        make_vessel(config)
    (tmp_path / "map.geojson").unlink()
    with pytest.raises(ConfigError, match="No such file"):
        make_vessel(config)


def test_the_point_of_a_chart_is_a_point_of_the_earth(tmp_path):
    """One rock, written by hand, where the datum's frame says."""
    root = collection(feature("Point", lon_lat(12.0, -7.0), twinscrew="hazard", radius_m=1.0))
    (tmp_path / "map.geojson").write_text(json.dumps(root))
    (tmp_path / "boat.toml").write_text(
        f'policy = "apf"\n{DATUM_TOML}[chart]\nfile = "{tmp_path}/map.geojson"\n'
    )
    vessel = make_vessel(load_config(tmp_path / "boat.toml"))
    vessel.tick(0.0)
    assert vessel.chart.distance_m(np.array([[22.0, -7.0]]))[0] == pytest.approx(9.0, abs=0.02)


@pytest.mark.slow
def test_send_says_in_the_boats_words_that_a_goal_is_on_land(tmp_path):
    """The command, Zenoh and the vessel are real; only the boat's loop is this test's."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    vessel = vessel_with(land=[LAND])
    feed(vessel, "odometry", cdr.encode_odometry(odometry(1.0, north=-20.0)), 1.0)
    (tmp_path / "boat.toml").write_text(f'[bus]\nconnect = ["{endpoint}"]\n')
    inbox = Inbox()
    with closing(ZenohBus(ZenohSettings(listen=(endpoint,)), "wamv")) as bus:
        inbox.listen(bus, ("goal", "berth"))

        def answer():
            for _ in range(3):
                message = next(iter(inbox.wait(60.0)))
                out = vessel.handle(message, 1.1)
                payload = cdr.encode_diagnostics(out.events, stamp_ns=stamp(1.1), hardware_id="")
                bus.publish("diagnostics", payload)

        boat = threading.Thread(target=answer)
        boat.start()
        words = ("--config", tmp_path / "boat.toml")
        refused = twinscrew("send", "goal", "15", "20", *words)
        taken = twinscrew("send", "goal", "100", "30", *words)
        face = ("--from-north", "0", "--from-east", "60", "--to-north", "1", "--to-east", "60")
        too_short = twinscrew("send", "berth", *face, *words)
        boat.join()
    assert refused.returncode == 2
    assert "refused (goal_forbidden): not taken: the goal, north 20.0 m" in refused.stderr
    assert "is on land (Mole)" in refused.stderr
    assert (taken.returncode, taken.stderr) == (0, "")
    assert too_short.returncode == 2
    assert "refused (station_refused): a face of 1.0 m is too short" in too_short.stderr
