"""AIS and radar in whole runs: in lock-step, and over UDP in real time."""

from dataclasses import replace
from pathlib import Path

import pytest

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sensors.marine import AisTransponders, MarineSettings, RadarUnit
from twinscrew.hil_sim.sitl import SitlReport, SitlSettings, sail
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recording import find_recordings
from twinscrew.runtime.settings import shipped
from twinscrew.runtime.vessel.replay import replay

POLICY = "ac_iqn_wam_v"
"""The one that was trained among small vessels and sees 20 m, as its LiDAR does here."""


def passage(ais: bool, folder: Path | None = None, sensor: str = "vrx32", **more) -> SitlReport:
    marine = MarineSettings(ais=AisTransponders() if ais else None, **more)
    settings = SitlSettings(policy=POLICY, sensor=sensor, lockstep=True, marine=marine)
    return sail(load_scenario("ship_crossing"), settings, folder)


def events_of(recording):
    for payload in recording.decisions():
        decision = cdr.decode_decision(payload)
        yield from (event for event in decision.events)


@pytest.mark.slow
def test_ais_alone_makes_the_boat_give_way_to_a_ship_that_the_lidar_sees_too_late(tmp_path):
    far = shipped("sensors", "vrx32").read_text(encoding="utf-8")
    sensor = tmp_path / "short_sighted.toml"
    sensor.write_text(far.replace("range_max_m = 130.0", "range_max_m = 20.0"), encoding="utf-8")
    (blind,) = passage(False, sensor=str(sensor)).vessels
    (aided,) = passage(True, tmp_path, sensor=str(sensor)).vessels
    assert blind.outcome == "collision"
    assert aided.outcome == "goal"
    assert aided.closest_approach_m > 0.3
    (recording,) = find_recordings(tmp_path / "wamv1")
    alarms = [event for event in events_of(recording) if event.name == "collision_course"]
    assert "NORDLYS" in alarms[0].detail


@pytest.mark.slow
def test_a_run_with_ais_and_radar_replays_to_the_same_decisions(tmp_path):
    passage(True, tmp_path, radar=RadarUnit())
    (recording,) = find_recordings(tmp_path / "wamv1")
    held = {message.topic for message in recording.messages()}
    assert {"nmea", "radar", "detections", "ais_targets"} <= held
    assert replay(recording).same


@pytest.mark.realtime
def test_in_real_time_ais_comes_as_datagrams_and_is_recorded(tmp_path):
    scenario = replace(load_scenario("ship_crossing"), time_limit_s=8.0)
    marine = MarineSettings(ais=AisTransponders(loss=0.0))
    sail(scenario, SitlSettings(marine=marine), tmp_path)
    (recording,) = find_recordings(tmp_path / "wamv1")
    said = [m for m in recording.messages() if m.topic == "nmea"]
    assert any("VDM" in cdr.decode_sentence(message.payload).text for message in said)
    decided = [cdr.decode_decision(payload) for payload in recording.decisions()]
    assert any(len(decision.tracks.id) for decision in decided)
    assert replay(recording).same
