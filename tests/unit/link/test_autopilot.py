import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.link.ardupilot import commands
from twinscrew.runtime.link.ardupilot.authority import AskManual
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.link.ardupilot.parameters import SAFETY
from twinscrew.runtime.mavlink import Signing, Wire
from twinscrew.runtime.settings import convert

BOAT, ARDUPILOT = mavlink.MAV_TYPE_SURFACE_BOAT, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
MANUAL, HOLD, LOITER = 0, 4, 5


class Puppet:
    """An autopilot that says exactly what a test wants, and remembers what it was told."""

    def __init__(self, link, *, system=1, component=1):
        self.link, self.wire, self.now_s = link, Wire(system, component), 0.0

    def beat(self, *, mode=MANUAL, armed=False, type_=BOAT, autopilot=ARDUPILOT, system_status=4):
        base = 1 | (128 if armed else 0)
        beat = (type_, autopilot, base, mode, system_status, 3)
        self.say(mavlink.MAVLink_heartbeat_message(*beat))

    def servos(self, left, right):
        outputs = [left, 0, right] + [0] * 13
        uptime_us = 60_000_000 + round(self.now_s * 1e6)
        self.say(mavlink.MAVLink_servo_output_raw_message(uptime_us, 0, *outputs))

    def text(self, words):
        self.say(mavlink.MAVLink_statustext_message(2, words.encode()))

    def ack(self, command, result):
        self.say(mavlink.MAVLink_command_ack_message(command, result))

    def say(self, message):
        self.link.receive(self.wire.encode(message), self.now_s)

    def hears(self, thrust=(0.0, 0.0)):
        """Let 50 ms pass; gives the messages that the link sends."""
        self.now_s += 0.05
        data = self.link.tick(self.now_s) + self.link.command(thrust, self.now_s)
        return Wire(9, 9).decode(data)

    def events(self):
        return [event.name for event in self.link.events(self.now_s)]


def puppet(**settings):
    settings = {"check_parameters": False, "accept_parameters": SAFETY, **settings}
    return Puppet(AutopilotLink(AutopilotSettings(**settings)))


def names(messages):
    return [message.get_type() for message in messages]


def override(messages):
    (message,) = [m for m in messages if m.get_type() == "RC_CHANNELS_OVERRIDE"]
    return message.chan1_raw, message.chan3_raw


def armed(**settings):
    boat = puppet(**settings)
    boat.beat(armed=True)
    return boat


def test_it_introduces_itself_as_the_vessels_onboard_computer():
    beats = [m for m in puppet().hears() if m.get_type() == "HEARTBEAT"]
    assert [(m.type, m.autopilot) for m in beats] == [
        (mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID)
    ]
    assert (beats[0].get_srcSystem(), beats[0].get_srcComponent()) == (1, 191)


def test_its_heart_beats_once_a_second():
    boat = puppet()
    beats = sum(names(boat.hears()).count("HEARTBEAT") for _ in range(200))
    assert beats == 10


def test_stop_streams_before_anything_was_heard():
    boat = puppet()
    assert all(override(boat.hears((800.0, 800.0))) == (1500, 1500) for _ in range(10))


def test_thrust_goes_out_on_channels_1_and_3_and_no_other():
    boat = armed()
    (message,) = [m for m in boat.hears((1000.0, -250.0)) if m.get_type() == "RC_CHANNELS_OVERRIDE"]
    assert (message.chan1_raw, message.chan3_raw) == (2000, 1250)
    others = [getattr(message, f"chan{n}_raw") for n in range(1, 19) if n not in (1, 3)]
    assert set(others) == {65535}


def test_thrust_may_go_out_as_manual_control():
    boat = armed(control="manual_control")
    (message,) = [m for m in boat.hears((1000.0, -250.0)) if m.get_type() == "MANUAL_CONTROL"]
    assert (message.target, message.y, message.z) == (1, 1000, -500)


@pytest.mark.parametrize("situation", [{"armed": False}, {"armed": True, "mode": HOLD}])
def test_thrust_is_stop_unless_armed_and_in_manual(situation):
    boat = puppet(receiver_fitted=False)
    boat.beat(**situation)
    assert override(boat.hears((500.0, 500.0))) == (1500, 1500)


def test_thrust_that_is_not_finite_is_stop():
    assert override(armed().hears((np.nan, np.inf))) == (1500, 1500)


def test_a_vehicle_that_is_no_ardupilot_boat_gets_no_thrust():
    for strange in ({"type_": mavlink.MAV_TYPE_GROUND_ROVER}, {"autopilot": 12}):
        boat = puppet()
        boat.beat(armed=True, **strange)
        assert override(boat.hears((500.0, 500.0))) == (1500, 1500)
        assert boat.events() == ["wrong_vehicle"]


def test_another_vehicles_messages_are_not_ours():
    link = AutopilotLink(AutopilotSettings(system_id=1, check_parameters=False))
    Puppet(link, system=2).beat(armed=True)
    Puppet(link, component=100).beat(armed=True)
    assert not link.status.connected


def test_a_loop_that_ticks_without_commanding_stops_the_boat():
    boat = armed()
    assert override(boat.hears((500.0, 500.0))) == (1750, 1750)
    heard = [m for k in range(1, 8) for m in Wire(9, 9).decode(boat.link.tick(0.05 + k * 0.05))]
    sent = [m.chan1_raw for m in heard if m.get_type() == "RC_CHANNELS_OVERRIDE"]
    assert sent
    assert set(sent) == {1500}


def streaming(boat, outputs=(1500, 1500), seconds=1.0, **beat):
    """Let time pass while outputs come at 20 Hz, and heartbeats."""
    for _ in range(round(seconds / 0.05)):
        boat.hears()
        boat.servos(*outputs)
        boat.beat(**beat)
    return boat


def test_silence_stops_thrust_within_half_a_second_and_has_a_name():
    boat = streaming(armed(), armed=True)
    boat.events()
    pulses = [override(boat.hears((500.0, 500.0))) for _ in range(12)]
    assert pulses[0] == (1750, 1750)
    assert pulses[10:] == [(1500, 1500)] * 2  # 0.55 s, 0.6 s
    assert boat.events() == ["autopilot_silent"]
    boat.beat(armed=True)
    assert override(boat.hears((500.0, 500.0))) == (1750, 1750)
    assert boat.events() == ["autopilot_recovered"]


@pytest.mark.parametrize("outputs_too", [True, False])
def test_without_streams_only_missing_heartbeats_are_silence(outputs_too):
    boat = armed()
    if outputs_too:  # one message now and then, as ArduPilot sends it unasked, is no stream
        boat.servos(1500, 1500)
    assert [override(boat.hears((500.0, 500.0))) for _ in range(60)][-1] == (1750, 1750)
    assert [override(boat.hears((500.0, 500.0))) for _ in range(20)][-1] == (1500, 1500)


def asked(boat, command, seconds=5.0):
    heard = [m for _ in range(round(seconds / 0.05)) for m in step(boat)]
    return [m for m in heard if m.get_type() == "COMMAND_LONG" and m.command == command]


def step(boat):
    heard = boat.hears()
    boat.beat(mode=boat.mode, armed=boat.armed)
    return heard


def in_state(mode=MANUAL, armed=False, **settings):
    boat = puppet(**settings)
    boat.mode, boat.armed = mode, armed
    boat.beat(mode=mode, armed=armed)
    return boat


ARM, SET_MODE, INTERVAL = 400, 176, 511


def test_it_never_arms_by_itself():
    assert asked(in_state(), ARM) == []


def test_told_to_it_asks_for_arming_once_a_second_until_it_is_armed():
    boat = in_state(arm=True)
    assert len(asked(boat, ARM)) == 5
    boat.armed = True
    boat.beat(armed=True)
    assert asked(boat, ARM) == []


def test_stop_streams_before_it_asks_for_arming():
    boat = in_state(arm=True)
    sent = [m for _ in range(20) for m in boat.hears()]
    asks = [m.get_type() == "COMMAND_LONG" and m.command == ARM for m in sent]
    assert names(sent[: asks.index(True)]).count("RC_CHANNELS_OVERRIDE") >= 2


def test_an_accepted_arming_counts_before_the_next_heartbeat():
    boat = in_state(arm=True)
    boat.hears()
    boat.ack(ARM, 0)
    assert override(boat.hears((500.0, 500.0))) == (1750, 1750)


def test_a_refused_arming_is_an_event_with_the_autopilots_reason():
    boat = in_state(arm=True)
    asked(boat, ARM, seconds=0.5)
    boat.events()
    boat.text("Arm: Radio failsafe on")
    boat.ack(ARM, 4)
    (said, refused) = boat.link.events(boat.now_s)
    assert (said.name, refused.name) == ("autopilot_says", "arming_refused")
    assert refused.detail == "Arm: Radio failsafe on"
    assert asked(boat, ARM, seconds=2.0)


def test_an_answer_to_somebody_elses_arming_is_not_ours():
    boat = in_state(arm=True)
    boat.hears()
    boat.say(mavlink.MAVLink_command_ack_message(ARM, 0, 0, 0, 255, 190))
    assert not boat.link.status.armed


def test_a_disarmed_boat_in_hold_is_asked_for_manual():
    (first, *_) = asked(in_state(HOLD), SET_MODE)
    assert (first.param1, first.param2) == (1.0, MANUAL)


def test_it_does_not_ask_for_manual_without_permission():
    assert asked(in_state(HOLD, ask_manual=AskManual.NEVER), SET_MODE) == []


def test_a_pilots_mode_change_wins_and_is_an_event():
    boat = in_state(armed=True, arm=True)
    step(boat)
    boat.mode = LOITER
    boat.beat(mode=LOITER, armed=True)
    assert boat.events() == ["mode_taken"]
    assert asked(boat, SET_MODE, seconds=30.0) == []


def test_a_pilot_with_a_receiver_gets_stop_then_his_channels_then_silence():
    boat = streaming(armed(receiver_fitted=True), armed=True)
    boat.hears((500.0, 500.0))
    streaming(boat, mode=LOITER, armed=True, seconds=0.05)
    sent = [m for _ in range(40) for m in boat.hears((500.0, 500.0))]
    pulses = [m.chan1_raw for m in sent if m.get_type() == "RC_CHANNELS_OVERRIDE"]
    assert pulses[0] == 1500
    assert pulses[-1] == 0
    assert set(pulses) == {1500, 0}
    assert len(pulses) < 20
    streaming(boat, mode=LOITER, armed=True)
    streaming(boat, mode=MANUAL, armed=True, seconds=0.1)
    assert override(boat.hears((500.0, 500.0))) == (1750, 1750)


def test_a_pilot_without_a_receiver_keeps_stop_streaming_so_that_no_failsafe_ends_his_mode():
    boat = armed(receiver_fitted=False)
    boat.beat(mode=LOITER, armed=True)
    assert all(override(boat.hears((500.0, 500.0))) == (1500, 1500) for _ in range(40))


def test_wanting_nothing_gives_an_armed_boat_to_the_pilots_receiver():
    boat = armed(receiver_fitted=True)
    sent = [m for _ in range(40) for m in boat.hears(None)]
    assert {m.chan1_raw for m in sent if m.get_type() == "RC_CHANNELS_OVERRIDE"} == {1500, 0}


def test_disarming_by_somebody_is_an_event_and_final():
    boat = in_state(armed=True, arm=True)
    step(boat)
    boat.armed = False
    boat.beat()
    assert boat.events() == ["autopilot_disarmed"]
    assert asked(boat, ARM) == []
    boat.link.ask_again()
    assert asked(boat, ARM)


def test_outputs_that_do_not_follow_are_an_event_that_names_the_likely_cause():
    boat = armed()
    for _ in range(40):
        boat.hears((500.0, 500.0))
        boat.servos(1500, 1500)
        boat.beat(armed=True)
    events = boat.link.events(boat.now_s)
    assert [event.name for event in events] == ["override_ignored"]
    assert "SYSID_MYGCS" in events[0].detail
    assert not boat.link.status.engaged


def test_every_message_is_asked_for_whatever_comes_already():
    boat = in_state(state_hz=20.0)
    boat.servos(1500, 1500)
    requests = asked(boat, INTERVAL, seconds=0.1)
    ids = [mavlink.mavlink_map[int(m.param1)].msgname for m in requests]
    assert ids == ["SERVO_OUTPUT_RAW", "HEARTBEAT", "LOCAL_POSITION_NED", "ATTITUDE"]
    assert [m.param2 for m in requests] == [1e5, 1e6, 5e4, 5e4]


def test_long_texts_are_sent_in_numbered_chunks():
    boat = puppet()
    boat.link.say("x" * 120)
    chunks = [m for m in boat.hears() if m.get_type() == "STATUSTEXT"]
    assert "".join(m.text for m in chunks) == "x" * 120
    assert [m.chunk_seq for m in chunks] == [0, 1, 2]
    assert len({m.id for m in chunks}) == 1
    assert chunks[0].id != 0


def test_an_endless_text_is_cut_to_what_chunks_can_be_numbered():
    boat = puppet()
    boat.link.say("x" * 13_000)
    chunks = [m for m in boat.hears() if m.get_type() == "STATUSTEXT"]
    assert [m.chunk_seq for m in chunks] == list(range(commands.MOST_CHUNKS))
    assert len(chunks[-1].text) < 50  # so a station knows that it is the last


def test_a_message_that_cannot_be_written_is_left_out_and_named_and_the_rest_is_sent():
    boat = armed()
    boat.events()
    boat.link.tell([mavlink.MAVLink_mission_item_reached_message(1 << 20)])
    boat.link.say("after it")
    assert [m.text for m in boat.hears() if m.get_type() == "STATUSTEXT"] == ["after it"]
    (event,) = boat.link.events(boat.now_s)
    assert event.name == "message_unsent"
    assert event.detail.startswith("MISSION_ITEM_REACHED: ")


def test_who_could_not_drive_asks_neither_for_manual_nor_for_arming():
    boat = in_state(arm=True)
    for _ in range(60):
        boat.now_s += 0.05
        sent = boat.link.tick(boat.now_s, may_ask=False) + boat.link.command(None, boat.now_s)
        asked_for = {m.command for m in Wire(9, 9).decode(sent) if m.get_type() == "COMMAND_LONG"}
        assert not asked_for & {ARM, mavlink.MAV_CMD_DO_SET_MODE}


def test_a_condition_is_told_once_when_it_begins_and_once_when_it_is_over():
    boat = armed()
    streaming(boat, mode=LOITER, armed=True)
    assert boat.events() == ["mode_taken"]
    assert boat.events() == []
    streaming(boat, mode=MANUAL, armed=True)
    assert boat.events() == ["autopilot_recovered"]


def test_a_chatty_autopilot_does_not_fill_the_memory():
    boat = puppet()
    boat.beat()
    for number in range(1000):
        boat.text(f"text {number}")
    assert len(boat.link.events(0.0)) <= 110


@given(st.lists(st.binary(max_size=100), max_size=20))
def test_no_bytes_from_the_network_raise(chunks):
    link = AutopilotLink(AutopilotSettings(check_parameters=False))
    for k, chunk in enumerate(chunks):
        link.receive(chunk, k * 0.05)
        link.tick(k * 0.05)
        link.command((1.0, 1.0), k * 0.05)
        link.events(k * 0.05)


MESSAGES = sorted(mavlink.mavlink_map)


@given(st.sampled_from(MESSAGES), st.binary(max_size=255))
def test_no_wellformed_message_with_wild_contents_raises(message_id, payload):
    link = AutopilotLink(AutopilotSettings())
    kind = mavlink.mavlink_map[message_id]
    padded = payload[: kind.unpacker.size].ljust(kind.unpacker.size, b"\0")
    frame = raw_frame(message_id, padded, kind.crc_extra)
    link.receive(frame, 0.0)
    link.tick(0.0)
    link.events(0.0)
    assert link.wire.bad_frames == 0


def raw_frame(message_id, payload, crc_extra):
    header = bytes([len(payload), 0, 0, 0, 1, 1]) + message_id.to_bytes(3, "little")
    crc = mavlink.x25crc(header + payload + bytes([crc_extra])).crc
    return b"\xfd" + header + payload + crc.to_bytes(2, "little")


def test_it_disarms_when_told_to():
    boat = in_state(armed=True)
    boat.link.disarm()
    (request,) = asked(boat, ARM, seconds=0.1)
    assert request.param1 == 0


def test_a_refused_manual_is_an_event():
    boat = in_state(HOLD)
    asked(boat, SET_MODE, seconds=0.1)
    boat.ack(SET_MODE, 4)
    assert boat.events() == ["mode_refused"]


def test_a_mode_without_a_name_is_told_by_number():
    boat = in_state(42)
    assert boat.link.status.mode == "mode 42"


def test_the_signing_key_may_come_from_a_file(tmp_path):
    path = tmp_path / "key"
    path.write_bytes(bytes(range(32)))
    path.chmod(0o600)
    boat = puppet(signing_key_file=str(path))
    boat.beat()
    assert not boat.link.status.connected
    assert boat.link.status.bad_frames > 0
    path.chmod(0o644)
    with pytest.raises(ConfigError, match="chmod 600"):
        puppet(signing_key_file=str(path))


@pytest.mark.parametrize(
    "wrong",
    [
        {"system_id": 0},
        {"system_id": 256},
        {"control": "semaphore"},
        {"paddles": {"astern_N": -500.0}},
        {"ask_manual": "always"},
        {"sysid": 1},
    ],
)
def test_settings_that_cannot_be_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        convert(wrong, AutopilotSettings)


def test_a_long_text_of_the_autopilot_is_told_whole():
    boat = in_state(arm=True)
    asked(boat, ARM, seconds=0.5)
    boat.events()
    words = "PreArm: " + "a very long reason indeed, " * 4
    for chunk in range(3):
        part = words[50 * chunk : 50 * (chunk + 1)].encode()
        boat.say(mavlink.MAVLink_statustext_message(2, part, 7, chunk))
    boat.ack(ARM, 4)
    said, refused = boat.link.events(boat.now_s)
    assert said.detail == refused.detail == words


def test_silence_at_the_start_says_what_was_heard_instead():
    boat = puppet()
    assert boat.link.events(0.0)[0].detail == "nothing heard yet"
    boat = puppet()
    beat = mavlink.MAVLink_heartbeat_message(BOAT, ARDUPILOT, 1, 0, 4, 3)
    boat.link.receive(beat.pack(boat.wire._codec, force_mavlink1=True), 0.0)
    assert "SERIALx_PROTOCOL" in boat.link.events(0.0)[0].detail
    signed = AutopilotLink(
        AutopilotSettings(check_parameters=False), signing=Signing(bytes(range(32)))
    )
    Puppet(signed).beat()
    assert "key" in signed.events(0.0)[0].detail


@pytest.mark.parametrize("system_status", [0, 1, 2])
def test_an_autopilot_that_initialises_is_asked_for_no_mode(system_status):
    boat = puppet()
    for _ in range(100):
        boat.beat(mode=HOLD, armed=False, system_status=system_status)
        assert not [m for m in boat.hears() if getattr(m, "command", 0) == SET_MODE]
    boat.mode, boat.armed = HOLD, False
    assert asked(boat, SET_MODE, seconds=2.0)


def test_after_a_restart_no_mode_is_asked_for_before_the_next_heartbeat():
    boat = in_state(mode=HOLD)
    boat.say(mavlink.MAVLink_attitude_message(60_000, 0, 0, 0, 0, 0, 0))
    assert asked(boat, SET_MODE, seconds=1.5)
    boat.say(mavlink.MAVLink_attitude_message(200, 0, 0, 0, 0, 0, 0))
    heard = [m for _ in range(40) for m in boat.hears()]
    assert not [m for m in heard if getattr(m, "command", 0) == SET_MODE]
    assert asked(boat, SET_MODE, seconds=1.5)


def test_each_of_several_reasons_not_to_arm_is_named_once():
    boat = in_state(arm=True)
    for _ in range(6):
        asked(boat, ARM, seconds=1.0)
        for words in (b"Arm: GPS 1: not healthy", b"Arm: Compass not calibrated"):
            boat.say(mavlink.MAVLink_statustext_message(2, words))
        boat.ack(ARM, 4)
    told = [e.detail for e in boat.link.events(boat.now_s) if e.name == "arming_refused"]
    assert told == ["Arm: Compass not calibrated; Arm: GPS 1: not healthy"]
