"""The same script against any ArduPilot Rover boat: ours always, a real one if there is a binary.

    ARDUROVER=/path/to/ardurover pytest tests/integration/test_mavlink_conformance.py

Every step was seen on ArduRover V4.6.0-dev. What passes on the real one and fails on ours is a
fault of ours. The simulated autopilot is spoken to over UDP too, but its time is simulated: the
script waits in steps of 20 ms, which take no time there.
"""

import os
import subprocess
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.rover import RoverSettings
from twinscrew.hil_sim.autopilot.udp import AutopilotOnTheNet
from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.parm import read_parm
from twinscrew.runtime.link.transport import UdpTransport, open_transport
from twinscrew.runtime.link.wire import Wire
from twinscrew.runtime.settings import CONFIG_DIR

PARAMETERS = CONFIG_DIR / "autopilot" / "ardurover.parm"
BINARY = os.environ.get("ARDUROVER", "")
STEP_S = 0.02
SYSTEM = 1
MANUAL, HOLD = 0, 4
ARM, SET_MODE, SET_SERVO, INTERVAL = 400, 176, 183, 511
REQUEST_MESSAGE = 512
SERVO_OUTPUT_RAW, RC_CHANNELS, GPS_GLOBAL_ORIGIN = 36, 65, 49


class Ours:
    """Our simulated autopilot behind a UDP socket, in simulated time."""

    tolerance_us = 1

    def __init__(self):
        settings = RoverAutopilotSettings(rover=RoverSettings(arming_delay_s=5.0))
        listener = UdpTransport("127.0.0.1", 0, listens=True)
        self._net = AutopilotOnTheNet(RoverAutopilot(settings, SYSTEM), listener)
        self.transport = open_transport(f"udpout:127.0.0.1:{listener.port}")
        self.now_s = 0.0

    def wait(self):
        self.now_s += STEP_S
        self._net.step(self.now_s, None)

    def close(self):
        self.transport.close()
        self._net.close()


class Real:
    """A real ArduRover in its own simulator, started here, in real time."""

    tolerance_us = 1

    def __init__(self, folder):
        arguments = ["--model", "rover-skid", "--speedup", "1", "--defaults", str(PARAMETERS)]
        with (folder / "log.txt").open("wb") as log:
            self._process = subprocess.Popen(
                [BINARY, "--wipe", *arguments], cwd=folder, stdout=log, stderr=log
            )
        for _ in range(100):
            try:
                self.transport = open_transport("tcp:127.0.0.1:5760")
                return
            except LinkError:
                time.sleep(0.1)
        self._process.kill()
        raise LinkError(f"{BINARY} does not listen on port 5760; see {folder / 'log.txt'}")

    @property
    def now_s(self):
        return time.monotonic()

    def wait(self):
        time.sleep(STEP_S)

    def close(self):
        self.transport.close()
        self._process.terminate()
        self._process.wait()


class Station:
    """Somebody who talks to an autopilot, and may stream its two paddles."""

    def __init__(self, endpoint):
        self.endpoint = endpoint
        self.wire, self.stranger = Wire(SYSTEM, 191), Wire(250, 191)
        self.paddles = (1500, 1500)
        self.streams = True
        self.last_paddles_s = 0.0
        self.heard = []
        self._next_s = self._beat_s = 0.0

    @property
    def now_s(self):
        return self.endpoint.now_s

    def send(self, message, wire=None):
        self.endpoint.transport.send((wire or self.wire).encode(message))

    def step(self):
        """Let 20 ms pass; gives what came."""
        if self.now_s >= self._beat_s:
            self._beat_s = self.now_s + 1.0
            self.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
        if self.streams and self.now_s >= self._next_s:
            self._next_s = self.now_s + 0.05
            self.last_paddles_s = self.now_s
            self.send(override(*self.paddles))
        self.endpoint.wait()
        heard = self.wire.decode(self.endpoint.transport.receive())
        self.heard += heard
        return heard

    def until(self, wanted, limit_s=10.0):
        """Wait for a message; gives the first for which `wanted` is true."""
        begin_s = self.now_s
        while self.now_s - begin_s < limit_s:
            for message in self.step():
                if wanted(message):
                    return message
        raise AssertionError(f"not heard within {limit_s} s of the autopilot's time")

    def next(self, kind, limit_s=10.0):
        return self.until(lambda message: message.get_type() == kind, limit_s)

    def command(self, command, *params):
        """Send a command; gives its result."""
        padded = [*params, *[0.0] * (7 - len(params))]
        self.send(mavlink.MAVLink_command_long_message(SYSTEM, 1, command, 0, *padded))
        return self.until(lambda m: m.get_type() == "COMMAND_ACK" and m.command == command).result

    def outputs(self, settle_s=0.3):
        """Give the left and right output after a while."""
        begin_s = self.now_s
        while self.now_s - begin_s < settle_s:
            self.step()
        message = self.next("SERVO_OUTPUT_RAW")
        return message.servo1_raw, message.servo3_raw

    def outputs_wanted(self):
        """Ask for SERVO_OUTPUT_RAW at 50 Hz."""
        assert self.command(INTERVAL, SERVO_OUTPUT_RAW, 20_000) == 0

    def ready(self):
        """Be armed, in MANUAL, with paddles at stop that stream."""
        self.paddles, self.streams = (1500, 1500), True
        self.outputs_wanted()
        self.outputs()
        assert self.command(SET_MODE, 1, MANUAL) == 0
        begin_s = self.now_s
        while (result := self.command(ARM, 1)) != 0:
            assert result == 4, "a refusal to arm is MAV_RESULT_FAILED"
            assert self.now_s - begin_s < 60.0, "still refuses to arm after 60 s"
            self.outputs(settle_s=1.0)
        return self


def override(left, right):
    channels = [left, 65535, right] + [65535] * 15
    return mavlink.MAVLink_rc_channels_override_message(SYSTEM, 1, *channels)


@pytest.fixture(scope="module", params=["ours", "ardurover"])
def station(request, tmp_path_factory):
    if request.param == "ardurover" and not BINARY:
        pytest.skip("no ArduRover binary: set ARDUROVER to its path to try the real one")
    real = request.param == "ardurover"
    endpoint = Real(tmp_path_factory.mktemp("ardurover")) if real else Ours()
    yield Station(endpoint)
    endpoint.close()


def test_it_is_a_boat(station):
    beat = station.next("HEARTBEAT")
    assert (beat.type, beat.autopilot) == (11, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (SYSTEM, 1)


def test_arming_is_refused_at_first_with_a_reason_and_then_done(station):
    station.outputs_wanted()
    station.heard.clear()
    assert station.command(ARM, 1) == 4
    station.outputs()
    texts = [m.text for m in station.heard if m.get_type() == "STATUSTEXT"]
    assert any(text.startswith(("Arm:", "PreArm:")) for text in texts)
    station.ready()
    beat = station.until(lambda m: m.get_type() == "HEARTBEAT" and m.base_mode & 128)
    assert beat.custom_mode == MANUAL


def test_messages_come_at_the_rate_they_are_asked_for(station):
    assert station.command(INTERVAL, SERVO_OUTPUT_RAW, 100_000) == 0
    station.heard.clear()
    station.outputs(settle_s=5.0)
    count = sum(m.get_type() == "SERVO_OUTPUT_RAW" for m in station.heard)
    assert 40 <= count <= 60


def test_parameters_are_as_the_shipped_file_sets_them(station):
    for name, value in read_parm(PARAMETERS).items():
        station.send(mavlink.MAVLink_param_request_read_message(SYSTEM, 1, name.encode(), -1))
        answer = station.until(
            lambda m, name=name: m.get_type() == "PARAM_VALUE" and m.param_id == name
        )
        assert answer.param_value == pytest.approx(value), name


@pytest.mark.parametrize("left", [1000, 1250, 1499, 1501, 1750, 2000])
def test_outputs_follow_overrides_one_to_one(station, left):
    station.ready().paddles = (left, 3000 - left)
    assert station.outputs() == pytest.approx(
        (left, 3000 - left), abs=station.endpoint.tolerance_us
    )


def test_manual_control_is_two_paddles(station):
    station.ready().streams = False
    for _ in range(20):
        station.send(mavlink.MAVLink_manual_control_message(SYSTEM, 0, 500, -500, 0, 0))
        station.step()
    message = station.next("SERVO_OUTPUT_RAW")
    outputs = (message.servo1_raw, message.servo3_raw)
    assert outputs == pytest.approx((1750, 1250), abs=station.endpoint.tolerance_us)


def test_a_strangers_overrides_are_silently_ignored(station):
    station.ready()
    station.heard.clear()
    for _ in range(25):
        station.send(override(1800, 1800), station.stranger)
        station.step()
    assert station.outputs(settle_s=0.0) == (1500, 1500)
    assert not [m for m in station.heard if m.get_type() == "STATUSTEXT"]


@pytest.mark.parametrize("servo", [1, 3])
def test_do_set_servo_is_refused_on_the_propellers(station, servo):
    station.ready()
    assert station.command(SET_SERVO, servo, 1800) == 4
    assert station.outputs() == (1500, 1500)


def test_when_overrides_stop_thrust_is_neutral_after_0_6_s_and_hold_comes_after_2_s(station):
    station.ready().paddles = (1700, 1700)
    station.outputs()
    assert station.command(INTERVAL, RC_CHANNELS, 100_000) == 0
    station.streams = False
    stopped_s = station.last_paddles_s
    station.until(lambda m: m.get_type() == "SERVO_OUTPUT_RAW" and m.servo1_raw == 1500)
    assert 0.45 <= station.now_s - stopped_s <= 0.8
    assert station.next("RC_CHANNELS").chan1_raw == 1700
    station.until(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == HOLD)
    # the heartbeat may be up to one second late
    assert 1.9 <= station.now_s - stopped_s <= 3.2


def test_hold_latches_until_manual_is_commanded(station):
    station.ready()
    station.streams = False
    station.until(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == HOLD)
    station.paddles, station.streams = (1700, 1700), True
    assert station.outputs(settle_s=3.0) == (1500, 1500)
    assert station.command(SET_MODE, 1, MANUAL) == 0
    assert station.outputs() == pytest.approx((1700, 1700), abs=station.endpoint.tolerance_us)


def test_where_its_local_frame_begins_is_told_when_asked_for(station):
    station.ready()
    station.heard.clear()
    assert station.command(REQUEST_MESSAGE, GPS_GLOBAL_ORIGIN) == 0
    station.outputs(settle_s=1.0)
    origins = [m for m in station.heard if m.get_type() == "GPS_GLOBAL_ORIGIN"]
    assert origins
    assert origins[0].latitude != 0
    assert origins[0].longitude != 0


def test_an_unknown_mode_is_refused(station):
    assert station.command(SET_MODE, 1, 99) != 0


def test_disarmed_it_gives_no_thrust(station):
    station.ready().paddles = (1700, 1700)
    station.outputs()
    station.paddles = (1500, 1500)
    station.outputs()
    assert station.command(ARM, 0) == 0
    station.paddles = (1700, 1700)
    assert station.outputs() == (1500, 1500)
