"""Who may drive thrusters that take newtons by topic, and for how long."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.harness.boat import FAR_AHEAD, Steady, cloud, make_pipeline, odometry

from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.errors import ConfigError, MessageError
from twinscrew.runtime.link.autopilot import Autopilot, AutopilotStatus
from twinscrew.runtime.link.thrusters import PAUSE_S, ThrusterLink, ThrusterSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Goal
from twinscrew.runtime.vessel.config import RuntimeConfig, config_for, inputs_of
from twinscrew.runtime.vessel.vessel import Vessel, make_vessel

ON, OFF = cdr.encode_enable(True), cdr.encode_enable(False)


def names(link: ThrusterLink, now_s: float) -> list[str]:
    return [event.name for event in link.events(now_s)]


def test_nobody_drives_before_an_enable_nor_without_consent() -> None:
    armed, not_armed = ThrusterLink(armed=True), ThrusterLink()
    for link in (armed, not_armed):
        link.tick(1.0)
        assert not link.status.engaged
        link.hear("enable", ON, 1.0)
    assert armed.status.engaged
    assert not not_armed.status.engaged
    assert names(armed, 1.0) == ["thrust_enabled"]
    assert names(not_armed, 1.0) == ["enable_refused"]
    assert not_armed.status.words == "thrust, not armed, enabled"


def test_an_enable_that_does_not_come_again_ends_and_comes_back_with_the_next() -> None:
    link = ThrusterLink(armed=True)
    for k in range(6):
        link.hear("enable", ON, k * 0.9)  # late each time, but in time
        assert link.status.engaged
    link.tick(5 * 0.9 + 1.0)
    assert link.status.engaged
    link.tick(5 * 0.9 + 1.01)
    assert not link.status.engaged
    assert names(link, 6.0) == ["thrust_enabled", "enable_lost"]
    link.hear("enable", ON, 9.0)
    assert link.status.engaged


def test_one_enable_is_enough_where_the_settings_say_so() -> None:
    link = ThrusterLink(ThrusterSettings(enable_max_age_s=0.0), armed=True)
    link.hear("enable", ON, 1.0)
    link.tick(1e6)
    assert link.status.engaged
    link.hear("enable", OFF, 1e6)
    assert not link.status.engaged


def test_a_false_stops_at_once_and_a_stream_of_true_that_goes_on_does_not_undo_it() -> None:
    link = ThrusterLink(armed=True)
    for k in range(10):
        link.hear("enable", ON, k * 0.2)
    link.hear("enable", OFF, 1.9)
    assert not link.status.engaged
    for k in range(10, 100):  # somebody else's stream goes on
        link.hear("enable", ON, k * 0.2)
        assert not link.status.engaged
    link.hear("enable", ON, 99 * 0.2 + PAUSE_S + 0.1)  # it paused: it begins anew
    assert link.status.engaged
    assert names(link, 21.0) == ["thrust_enabled", "thrust_disabled", "thrust_enabled"]


@given(st.lists(st.tuples(st.floats(0.0, 1.5), st.sampled_from("tf.")), max_size=60))
def test_it_never_drives_after_a_false_until_true_has_paused_nor_longer_than_allowed(steps) -> None:
    link, now_s = ThrusterLink(armed=True), 0.0
    last_true_s, barred = -np.inf, False
    for gap_s, what in steps:
        now_s += gap_s
        if what == "t":
            barred = barred and now_s - last_true_s <= PAUSE_S
            last_true_s = now_s
            link.hear("enable", ON, now_s)
        elif what == "f":
            barred = True
            link.hear("enable", OFF, now_s)
        else:
            link.tick(now_s)
        assert not (barred and link.status.engaged)
        assert not (now_s - last_true_s > 1.0 and link.status.engaged)
        if what == "t" and not barred:
            assert link.status.engaged


@pytest.mark.parametrize("payload", [b"", b"\x00\x01\x00\x00", b"\x00\x01\x00\x00\x02", ON + OFF])
def test_what_is_no_bool_is_refused(payload: bytes) -> None:
    with pytest.raises(MessageError):
        ThrusterLink(armed=True).hear("enable", payload, 1.0)


def test_it_has_all_that_a_vessel_asks_of_an_autopilot() -> None:
    link = ThrusterLink()
    for protocol, made in ((Autopilot, link), (AutopilotStatus, link.status)):
        asked = {name for name in vars(protocol) if not name.startswith("_")}
        assert len(asked) >= 5
        assert not {name for name in asked if not hasattr(made, name)}


# -- In a vessel.


class Dock:
    """A vessel whose thrusters are driven by topic, with sensors."""

    def __init__(self) -> None:
        self.vessel = Vessel(
            make_pipeline(Steady(), FAR_AHEAD), ThrusterLink(armed=True), looks_first=False
        )
        self.now_s = 0.0
        self.thrusts: list[float] = []

    def give(self, topic: str, payload: bytes):
        return self.vessel.handle(Received(topic, payload, 0), self.now_s)

    def run(self, duration_s: float, *, enable=True, sensors=True) -> float:
        """Run; give how long the propellers turned on, from the begin [s]."""
        begin_s, last_s = self.now_s, 0.0
        for _ in range(round(duration_s / 0.05)):
            if sensors:
                self.give("odometry", cdr.encode_odometry(odometry(self.now_s)))
                self.give("points", cdr.encode_point_cloud(cloud(self.now_s)))
            if enable:
                self.give("enable", ON)
            thrust = self.vessel.tick(self.now_s).thrust
            self.now_s += 0.05
            if thrust.any():
                last_s = self.now_s - begin_s
        return last_s


def test_the_boat_drives_while_enabled_and_is_neutral_in_time_when_anything_stops() -> None:
    dock = Dock()
    assert dock.run(3.0, enable=False) == 0.0
    assert dock.run(3.0) == pytest.approx(3.0)
    assert dock.run(3.0, sensors=False) <= 0.5
    assert dock.run(3.0) == pytest.approx(3.0)
    assert dock.run(3.0, enable=False) <= 1.1
    assert dock.run(3.0) == pytest.approx(3.0)


def test_a_disable_gives_zero_with_the_very_message() -> None:
    dock = Dock()
    assert dock.run(3.0) == pytest.approx(3.0)
    out = dock.give("enable", OFF)
    assert not out.thrust.any()
    assert [taken.topic for taken in out.messages] == ["enable", "engagement"]
    assert not cdr.decode_engagement(out.messages[1].payload).engaged


def test_what_is_no_enable_is_a_named_event_and_changes_nothing() -> None:
    dock = Dock()
    dock.run(3.0)
    out = dock.give("enable", b"\xff" * 9)
    assert [event.name for event in out.events] == ["bad_message"]
    assert out.thrust.any()


# -- In the configuration.


def config(**autopilot: object) -> RuntimeConfig:
    return config_for("wam_v", autopilot={"kind": "thrust", **autopilot})


def test_the_kind_is_chosen_in_the_configuration() -> None:
    made = config(arm=True, options={"enable_max_age_s": 0.4})
    assert "enable" in inputs_of(made)
    assert "enable" not in inputs_of(RuntimeConfig())
    link = make_vessel(made).link
    assert isinstance(link, ThrusterLink)
    link.hear("enable", ON, 1.0)
    link.tick(1.41)
    assert not link.status.engaged


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"odometry_source": "autopilot"}, "thrusters tell no odometry; allowed are bus, gps_imu"),
        ({"bus": {"connect": []}}, "bus.connect: with autopilot.kind = 'thrust'"),
    ],
)
def test_what_such_thrusters_cannot_do_is_refused(given, words) -> None:
    with pytest.raises(ConfigError, match=words):
        config_for("wam_v", autopilot={"kind": "thrust"}, **given)


def test_an_unknown_option_is_refused_by_name() -> None:
    with pytest.raises(ConfigError, match=r"autopilot\.options\.enable"):
        make_vessel(config(options={"enable": 1.0}))


def test_a_goal_given_now_is_told_with_the_vessels_time() -> None:
    dock = Dock()
    dock.run(1.0)
    place = Goal(stamp_ns=0, position_N=np.array([1.0, 2.0]))
    (event,) = dock.give("goal", cdr.encode_goal(place, frame_id="")).events
    assert event.stamp_ns == dock.vessel.stamp_ns > 0
