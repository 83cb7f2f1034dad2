"""The operational envelope: estimates, hysteresis, responses; and the vessel that obeys them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.harness.boat import SECOND, Steady, cloud, feed, make_pipeline, odometry, stamp

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.runtime.errors import ConfigError, MessageError
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import RESPONSES
from twinscrew.runtime.messages.types import Fallback
from twinscrew.runtime.safety.envelope import (
    LEAST,
    QUANTITIES,
    Bound,
    Envelope,
    EnvelopeSettings,
    Response,
    SeaState,
    Visibility,
    slowed,
)
from twinscrew.runtime.vessel.config import RuntimeConfig, load_config
from twinscrew.runtime.vessel.health import State
from twinscrew.runtime.vessel.vessel import Vessel, slow_of, vessel_for_replay


def watching(**bounds: dict) -> Envelope:
    """An envelope of which only some quantities say anything, at once unless told otherwise."""
    quiet = {name: Bound(limit=1e9 if name not in LEAST else 1e-9) for name in QUANTITIES}
    given = {
        name: Bound(**{"after_s": 0.0, "back_after_s": 1.0, **b}) for name, b in bounds.items()
    }
    return Envelope(EnvelopeSettings(**{**quiet, **given}))


def seen(envelope: Envelope, values: list[float], name: str = "traffic", every_s: float = 0.1):
    """Feed a quantity; gives the response after each."""
    responses = []
    for k, value in enumerate(values):
        envelope.step({name: value}, k * every_s, k)
        responses.append(envelope.response)
    return responses


def test_a_quantity_beyond_its_limit_for_long_enough_brings_its_response_and_is_named() -> None:
    envelope = watching(traffic={"limit": 6.0, "response": "slow", "after_s": 0.5})
    events = []
    for k in range(10):
        events += envelope.step({"traffic": 8.0}, k * 0.1, k)
    assert [event.name for event in events] == ["envelope_left", "fallback"]
    assert events[0].stamp_ns == 5
    assert events[1].detail == "fallback response slow: traffic 8, proved up to 6"


@given(st.lists(st.sampled_from([0.0, 5.5, 6.5, 9.0]), max_size=60))
def test_between_well_inside_and_the_limit_nothing_changes(values: list[float]) -> None:
    envelope = watching(traffic={"limit": 6.0, "response": "slow"})
    before = Response.NONE
    for value, response in zip(values, seen(envelope, values), strict=True):
        if response is not before:
            assert value > 6.0 if response is Response.SLOW else value <= 5.4
        before = response


@pytest.mark.parametrize("name", sorted(LEAST))
def test_visibility_and_depth_must_not_be_less(name: str) -> None:
    envelope = watching(**{name: {"limit": 10.0, "response": "stop"}})
    assert seen(envelope, [12.0, 9.0], name) == [Response.NONE, Response.STOP]
    assert seen(envelope, [math.inf] * 30, name)[-1] is Response.NONE


def test_what_cannot_be_estimated_counts_only_where_it_is_required() -> None:
    for required, response in ((False, Response.NONE), (True, Response.HOLD)):
        envelope = watching(depth_m={"response": "hold", "required": required})
        envelope.step({}, 0.0, 0)
        assert envelope.response is response


def test_a_quantity_that_is_lost_outside_is_not_taken_for_inside() -> None:
    envelope = watching(depth_m={"limit": 2.0, "response": "stop"})
    assert seen(envelope, [1.0] + [math.nan] * 100, "depth_m")[-1] is Response.STOP


@given(st.lists(st.sampled_from(RESPONSES), min_size=len(QUANTITIES), max_size=len(QUANTITIES)))
def test_the_worst_response_of_all_that_are_left_counts(responses: list[str]) -> None:
    wanted = dict(zip(QUANTITIES, responses, strict=True))
    envelope = watching(**{name: {"limit": 1.0, "response": r} for name, r in wanted.items()})
    envelope.step({name: 0.5 if name in LEAST else 2.0 for name in QUANTITIES}, 0.0, 0)
    assert envelope.response.value == max(responses, key=RESPONSES.index)


def test_a_boat_that_was_handed_over_waits_for_an_operators_new_order() -> None:
    envelope = watching(traffic={"limit": 1.0, "response": "hand_over"})
    envelope.step({"traffic": 2.0}, 0.0, 0, order=4)
    for k in range(100):
        envelope.step({"traffic": 0.0}, 1.0 + k, k, order=4)
    assert envelope.response is Response.HAND_OVER
    envelope.step({"traffic": 0.0}, 200.0, 0, order=5)
    assert envelope.response is Response.NONE


def test_switched_off_it_says_and_does_nothing() -> None:
    envelope = Envelope(EnvelopeSettings(enabled=False))
    assert envelope.step({"depth_m": 0.0, "traffic": 99.0}, 0.0, 0) == []
    assert envelope.response is Response.NONE


# -- Estimates.


def sea_of(amplitude_m: float, roll_deg: float = 0.0, *, tide_mps: float = 0.0) -> SeaState:
    sea = SeaState()
    for k in range(600):
        time_s = k * 0.05
        at = odometry(time_s)
        wave = math.sin(math.tau * time_s / 5.0)
        position = np.array([0.0, 0.0, amplitude_m * wave + tide_mps * time_s])
        q = quaternion_from_euler(math.radians(roll_deg) * wave, 0.0, 1.0)
        sea.step(replace(at, position_N=position, q_NB=q))
    return sea


@pytest.mark.parametrize("tide_mps", [0.0, 0.02])
def test_waves_are_measured_by_heave_whatever_the_tide(tide_mps: float) -> None:
    sea = sea_of(0.5, tide_mps=tide_mps)
    height_m, _ = sea.step(odometry(30.0))
    assert height_m == pytest.approx(4.0 * 0.5 / math.sqrt(2.0), rel=0.1)


def test_rolling_is_measured_as_twice_its_standard_deviation() -> None:
    _, angle_deg = sea_of(0.0, roll_deg=6.0).step(odometry(30.0))
    assert angle_deg == pytest.approx(2.0 * 6.0 / math.sqrt(2.0), rel=0.1)


def test_nothing_is_said_of_the_sea_before_it_was_measured_or_after_a_gap() -> None:
    sea = SeaState()
    assert all(math.isnan(v) for v in sea.step(odometry(0.0)))
    sea = sea_of(0.5)
    assert all(math.isnan(v) for v in sea.step(odometry(60.0)))


@pytest.mark.parametrize("visibility_m", [20.0, 60.0, 300.0])
def test_visibility_is_found_from_beams_that_end_in_the_air(visibility_m: float) -> None:
    rng = np.random.default_rng(0)
    ends = rng.exponential(visibility_m, (32, 2000))
    image = np.where(ends < 20.0, ends, 0.0).astype(np.float32)
    known = Visibility(np.linspace(-0.2, 0.5, 32), 20.0).step(lambda: image, 0.0)
    assert known == pytest.approx(visibility_m, rel=0.1)


def test_what_stands_low_is_no_fog_and_a_lidar_that_looks_down_knows_nothing() -> None:
    image = np.zeros((32, 2000), dtype=np.float32)
    image[:10] = 8.0  # a quay all around
    assert Visibility(np.linspace(-0.2, 0.5, 32), 20.0).step(lambda: image, 0.0) == math.inf
    assert math.isnan(Visibility(np.linspace(-0.4, 0.0, 32), 20.0).step(lambda: image, 0.0))


def test_a_high_wall_on_one_side_is_no_fog() -> None:
    image = np.zeros((32, 2000), dtype=np.float32)
    image[:, :1300] = 4.0  # two thirds of the horizon
    assert Visibility(np.linspace(-0.2, 0.5, 32), 20.0).step(lambda: image, 0.0) == math.inf


@given(
    st.tuples(st.floats(-500, 1000), st.floats(-500, 1000)),
    st.floats(-2, 5),
)
def test_slow_keeps_the_turn_and_asks_for_no_more_than_its_speed(thrust, surge) -> None:
    given_N = np.array(thrust)
    slow = slowed(given_N, surge, 1.2, 300.0)
    assert slow[1] - slow[0] == pytest.approx(given_N[1] - given_N[0], abs=1e-9)
    assert slow.mean() <= max(300.0 * (1.2 - surge), -1e9) + 1e-9 or np.array_equal(slow, given_N)
    assert slow.mean() <= given_N.mean() + 1e-9


# -- The file.


def test_a_file_of_an_envelope_is_read_and_its_errors_name_it(tmp_path) -> None:
    boat, file = tmp_path / "boat.toml", tmp_path / "harbour.toml"
    boat.write_text('envelope = "harbour.toml"\n')
    file.write_text('[depth_m]\nlimit = 3.0\nresponse = "hold"\nrequired = true\n')
    depth = load_config(boat).envelope.depth_m
    assert (depth.limit, depth.response, depth.required) == (3.0, "hold", True)
    file.write_text("[depth]\nlimit = 3.0\n")
    with pytest.raises(ConfigError, match="depth") as caught:
        load_config(boat)
    assert "harbour.toml" in str(caught.value)


@pytest.mark.parametrize("response", RESPONSES)
def test_a_fallback_is_written_and_read(response: str) -> None:
    told = Fallback(stamp_ns=stamp(1.0), response=response, reason="depth_m 0.5, proved down to 1")
    assert cdr.decode_fallback(cdr.encode_fallback(told)) == told


def test_a_response_that_there_is_not_is_no_message() -> None:
    payload = bytearray(cdr.encode_fallback(Fallback(stamp_ns=0, response="hand_over")))
    payload[12] = 9
    with pytest.raises(MessageError, match="9 is not a response"):
        cdr.decode_fallback(bytes(payload))


# -- The vessel.


class Sailing:
    """A vessel that drives north, and whose echo sounder says what the test wants."""

    def __init__(self, response: str, *, receiver: bool = False) -> None:
        settings = AutopilotSettings(arm=True, receiver_fitted=receiver)
        self.vessel = Vessel(
            make_pipeline(Steady((400.0, 400.0))),
            AutopilotLink(settings),
            envelope=watching(depth_m={"limit": 2.0, "response": response}),
            slow=slow_of(RuntimeConfig()),
        )
        self.pilot = RoverAutopilot(RoverAutopilotSettings(), 1)
        self.pilot.rover.parameters.set("SIM_DEPTH", 10.0)
        self.now_s, self.north_m, self.outs, self.surge = 0.0, 0.0, [], 0.0

    def sail(self, seconds: float) -> "Sailing":
        for _ in range(round(seconds / 0.05)):
            self.now_s = round(self.now_s + 0.05, 6)
            self.north_m += 0.05 * self.surge
            at = odometry(self.now_s, north=self.north_m)
            at = replace(at, velocity_B=np.array([self.surge, 0.0, 0.0]))
            self.note(feed(self.vessel, "odometry", cdr.encode_odometry(at), self.now_s))
            if round(self.now_s / 0.05) % 2 == 0:
                scan = cdr.encode_point_cloud(cloud(self.now_s))
                self.note(feed(self.vessel, "points", scan, self.now_s))
            self.note(self.vessel.receive(self.pilot.step(self.now_s, at), self.now_s))
            self.note(self.vessel.tick(self.now_s))
        return self

    def note(self, out) -> None:
        self.outs.append(out)
        self.pilot.receive(out.autopilot, self.now_s)

    def events(self, name: str) -> list[str]:
        return [e.detail for out in self.outs for e in out.events if e.name == name]


def shallow(response: str, **how) -> Sailing:
    boat = Sailing(response, **how).sail(6.0)
    assert boat.vessel.health.state is State.ACTIVE
    boat.pilot.rover.parameters.set("SIM_DEPTH", 1.0)
    return boat.sail(3.0)


def test_stop_stops_and_says_so_and_sails_on_in_deeper_water() -> None:
    boat = shallow("stop")
    assert boat.vessel.health.state is State.SAFE
    assert not boat.outs[-1].thrust.any()
    assert boat.pilot.rover.propellers == (1500, 1500)
    assert boat.events("fallback") == ["fallback response stop: depth_m 1, proved down to 2"]
    boat.pilot.rover.parameters.set("SIM_DEPTH", 10.0)
    assert boat.sail(4.0).vessel.health.state is State.ACTIVE
    assert boat.outs[-1].thrust.any()


def test_slow_sails_on_no_faster_than_its_share() -> None:
    boat = shallow("slow")
    assert boat.vessel.health.state is State.DEGRADED
    assert boat.outs[-1].thrust.mean() > 0.0
    boat.surge = slow_of(RuntimeConfig()).top_mps
    boat.sail(2.0)
    assert boat.outs[-1].thrust.mean() < 0.0  # it brakes


def test_hold_keeps_the_place_and_heads_back_when_it_drifts() -> None:
    boat = shallow("hold")
    assert boat.vessel.health.state is State.DEGRADED
    assert not boat.outs[-1].thrust.any()
    boat.north_m = 0.0
    while boat.north_m < 5.0:  # twice the radius of the goal, slowly: a jump would be no drift
        boat.north_m += 0.5
        boat.sail(0.2)
    assert boat.outs[-1].thrust.any()
    before = boat.vessel.pipeline.mission.goal
    boat.pilot.rover.parameters.set("SIM_DEPTH", 10.0)
    boat.sail(4.0)
    assert boat.vessel.pipeline.mission.goal is not before


def test_a_boat_without_a_goal_is_not_held_against_a_pilots_sticks() -> None:
    boat = Sailing("hold", receiver=True).sail(6.0)
    nothing = cdr.encode_path(np.empty((0, 2)), stamp_ns=stamp(boat.now_s))
    boat.note(feed(boat.vessel, "route", nothing, boat.now_s))
    boat.sail(2.0)
    assert boat.vessel.health.state is State.READY
    boat.pilot.rover.parameters.set("SIM_DEPTH", 1.0)
    assert boat.sail(3.0).vessel.health.state is State.READY
    assert boat.vessel.envelope.response is Response.HOLD
    assert not boat.vessel.pipeline.mission.holds


@pytest.mark.parametrize("response", RESPONSES)
def test_outside_it_a_pilot_still_steers_a_boat_that_has_no_goal(response: str) -> None:
    boat = Sailing(response, receiver=True).sail(6.0)
    nothing = cdr.encode_path(np.empty((0, 2)), stamp_ns=stamp(boat.now_s))
    boat.note(feed(boat.vessel, "route", nothing, boat.now_s))
    boat.pilot.rover.parameters.set("SIM_RC_FAIL", 0.0)
    boat.pilot.rover.radio.sticks[0] = boat.pilot.rover.radio.sticks[2] = 1700
    boat.sail(3.0)
    assert boat.pilot.rover.propellers == (1700, 1700)
    boat.pilot.rover.parameters.set("SIM_DEPTH", 1.0)
    assert boat.sail(3.0).pilot.rover.propellers == (1700, 1700)


def test_hand_over_gives_the_channels_back_and_waits_for_an_order() -> None:
    boat = shallow("hand_over", receiver=True)
    boat.sail(2.0)
    assert boat.vessel.health.state is State.SAFE
    assert not boat.outs[-1].thrust.any()
    boat.pilot.rover.parameters.set("SIM_DEPTH", 10.0)
    assert boat.sail(5.0).vessel.health.state is State.SAFE


def test_what_it_does_and_why_is_in_its_sentence_and_in_its_state() -> None:
    boat = shallow("slow")
    said = boat.vessel.explain(boat.vessel.decision)
    assert said.sentence.startswith("Fallback response slow: depth_m 1, proved down to 2. ")
    assert boat.vessel.envelope.state.startswith("slow: ")
    assert "depth_m 1, proved down to 2" in boat.vessel.envelope.state


@pytest.mark.parametrize("response", ["slow", "hold", "stop"])
def test_a_replay_of_what_it_took_in_decides_the_same(response: str) -> None:
    boat = shallow(response)
    decided = [cdr.encode_decision(out.decision) for out in boat.outs if out.decision]
    again = Sailing(response).vessel
    taken = [taken for out in boat.outs for taken in out.messages]
    assert any(t.topic == "fallback" for t in taken)
    replayed = []
    for message in taken:
        out = feed(again, message.topic, message.payload, 0.0)
        replayed += [cdr.encode_decision(out.decision)] if out.decision else []
    assert replayed == decided


def test_a_replayed_vessel_takes_the_recordings_word_and_watches_nothing_itself() -> None:
    vessel = vessel_for_replay(RuntimeConfig(policy="apf"))
    told = Fallback(stamp_ns=SECOND, response="stop", reason="depth")
    feed(vessel, "fallback", cdr.encode_fallback(told), 0.0)
    assert vessel.pipeline.stopped
