"""Wherever odometry comes from, the vessels arrive, and a replay decides the same."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twinscrew.hil_sim.bridges.ardupilot_fleet import ArduPilotSettings
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sensors.navigation import NavigationSettings, ReceiverSettings
from twinscrew.hil_sim.sitl import sail
from twinscrew.hil_sim.sitl_settings import AutopilotKind, OdometrySource, SitlSettings
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import wrap
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recording import Recording, find_recordings
from twinscrew.runtime.vessel.replay import combined_sha256, replay

pytestmark = pytest.mark.slow

HEAD_ON = load_scenario("head_on")


def in_step(source: OdometrySource, **more: object) -> SitlSettings:
    return SitlSettings(sensor="vrx16", lockstep=True, odometry=source, **more)


def events_of(recording: Recording) -> list[tuple[str, int]]:
    told = recording.messages(("diagnostics",))
    return [
        (event.name, event.stamp_ns)
        for message in told
        for event in cdr.decode_diagnostics(message.payload)
    ]


@pytest.mark.parametrize("source", OdometrySource)
def test_both_vessels_arrive_and_decide_the_same_again(
    source: OdometrySource, tmp_path: Path
) -> None:
    report = sail(HEAD_ON, in_step(source), tmp_path / "run")
    assert [vessel.outcome for vessel in report.vessels] == ["goal", "goal"]
    replays = [replay(recording) for recording in find_recordings(tmp_path / "run")]
    assert all(again.same for again in replays)
    assert combined_sha256(again.sha256 for again in replays) == report.sha256


def test_vessels_leave_the_dock_when_they_know_where_they_are(tmp_path: Path) -> None:
    brief = replace(HEAD_ON, time_limit_s=0.5)
    sail(brief, in_step(OdometrySource.GPS_IMU), tmp_path / "run")
    for recording, start in zip(find_recordings(tmp_path / "run"), brief.starts, strict=True):
        first = next(m for m in recording.inputs() if m.topic == "odometry")
        odometry = cdr.decode_odometry(first.payload)
        assert np.hypot(*(odometry.position_N[:2] - start[:2])) < 1.0  # [m] a fix: 0.5 each way
        assert np.hypot(*odometry.velocity_B[:2]) < 1.5  # [m/s] it lies still; 0.5 each way
        assert abs(wrap(odometry.heading - float(start[2]))) < 0.06
        names = [name for name, _ in events_of(recording)]
        assert names.index("estimate_ready") < names.index("goal_set")


def test_a_receiver_that_fails_for_a_while_is_told_and_the_vessels_arrive(tmp_path: Path) -> None:
    receiver = ReceiverSettings(outages_s=((5.0, 8.0),))
    navigation = NavigationSettings(receiver=receiver)
    report = sail(HEAD_ON, in_step(OdometrySource.GPS_IMU, navigation=navigation), tmp_path / "run")
    assert report.success
    for recording in find_recordings(tmp_path / "run"):
        names = [name for name, _ in events_of(recording)]
        assert names.count("gps_lost") == 3
        assert names.count("gps_back") == 1
        assert "odometry_stale" not in names[names.index("gps_lost") :]


def test_the_same_seed_gives_the_same_estimate_and_another_seed_another() -> None:
    brief = replace(HEAD_ON, time_limit_s=3.0)
    hashes = [sail(brief, in_step(OdometrySource.GPS_IMU, seed=seed)).sha256 for seed in (0, 0, 1)]
    assert hashes[0] == hashes[1] != hashes[2]


def test_ardupilot_is_not_asked_for_what_it_does_not_send(tmp_path: Path) -> None:
    settings = SitlSettings(
        autopilot=AutopilotKind.ARDUPILOT,
        ardupilot=ArduPilotSettings(),
        odometry=OdometrySource.AUTOPILOT_ODOMETRY,
    )
    with pytest.raises(ConfigError, match="ArduPilot sends no ODOMETRY"):
        sail(HEAD_ON, settings, tmp_path / "run")
