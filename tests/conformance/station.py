"""Somebody who talks to an autopilot as companion, and may stream its two paddles."""

from __future__ import annotations

from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tests.conformance.endpoints import SYSTEM, Endpoint

from twinscrew.runtime.mavlink import Message, Wire

MANUAL, HOLD = 0, 4
ARM, SET_MODE, SET_SERVO, INTERVAL, REQUEST_MESSAGE, CALIBRATE = 400, 176, 183, 511, 512, 241
HEARTBEAT_S, PADDLES_S = 1.0, 0.05
ARMING_LIMIT_S = 90.0
"""[s] A real one refuses for about 20 s after it starts."""
PATIENCE_S = 6.0
"""[s] A refusal that waiting does not mend ends a step after so long."""
PASSES = ("AHRS", "EKF", "GPS", "Gyros", "Initialis", "Waiting", "Radio failsafe", "position")
"""Reasons that pass by themselves hold one of these words; all others need somebody."""
NEEDS_CALIBRATION = "Accel calibration needed"
CALIBRATION_LIMIT_S = 30.0


class Station:
    """A companion's end of the conversation, and a ground station's beside it."""

    def __init__(self, endpoint: Endpoint) -> None:
        self.endpoint = endpoint
        self.wire, self.stranger, self.ground = Wire(SYSTEM, 191), Wire(250, 191), Wire(255, 190)
        self.paddles = (1500, 1500)
        self.streams = True
        self.last_paddles_s = 0.0
        self.heard: list[Message] = []
        self.heard_on_ground: list[Message] = []
        self._next_s = self._beat_s = 0.0

    @property
    def now_s(self) -> float:
        """[s] The autopilot's time."""
        return self.endpoint.now_s

    def send(self, message: Message, wire: Wire | None = None) -> None:
        """Say something as companion, or as somebody else on its line."""
        self.endpoint.companion.send((wire or self.wire).encode(message))

    def send_from_ground(self, message: Message) -> None:
        """Say something on the ground station's line."""
        self.endpoint.ground.send(self.ground.encode(message))

    def step(self) -> list[Message]:
        """Let 20 ms pass; gives what the companion hears."""
        if self.now_s >= self._beat_s:
            self._beat_s = self.now_s + HEARTBEAT_S
            self.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
            self.send_from_ground(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        if self.streams and self.now_s >= self._next_s:
            self._next_s = self.now_s + PADDLES_S
            self.last_paddles_s = self.now_s
            self.send(override(*self.paddles))
        self.endpoint.wait()
        heard = self.wire.decode(self.endpoint.companion.receive())
        self.heard += heard
        self.heard_on_ground += self.ground.decode(self.endpoint.ground.receive())
        return heard

    def until(self, wanted: Callable[[Message], bool], limit_s: float = 10.0) -> Message:
        """Wait for a message; gives the first for which `wanted` is true."""
        begin_s = self.now_s
        while self.now_s - begin_s < limit_s:
            for message in self.step():
                if wanted(message):
                    return message
        raise AssertionError(f"not heard within {limit_s} s of the autopilot's time")

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        begin_s = self.now_s
        while self.now_s - begin_s < seconds:
            self.step()

    def next(self, kind: str, limit_s: float = 10.0) -> Message:
        """Wait for the next message of the autopilot of a kind."""
        return self.until(lambda m: m.get_type() == kind and m.get_srcComponent() == 1, limit_s)

    def command(self, command: int, *params: float, limit_s: float = 10.0) -> int:
        """Send a command; gives its result."""
        padded = [*params, *[0.0] * (7 - len(params))]
        self.send(mavlink.MAVLink_command_long_message(SYSTEM, 1, command, 0, *padded))
        answer = self.until(
            lambda m: m.get_type() == "COMMAND_ACK" and m.command == command, limit_s
        )
        return int(answer.result)

    def outputs(self, settle_s: float = 0.3) -> tuple[int, int]:
        """Give the left and right output after a while."""
        self.wait(settle_s)
        message = self.next("SERVO_OUTPUT_RAW")
        return message.servo1_raw, message.servo3_raw

    def follows(self, left: int, right: int) -> bool:
        """Tell whether the outputs come to be these, to 1 us (measured)."""
        outputs = self.outputs()
        return abs(outputs[0] - left) <= 1 and abs(outputs[1] - right) <= 1

    def parameter(self, name: str) -> float:
        """Read a parameter."""
        self.send(mavlink.MAVLink_param_request_read_message(SYSTEM, 1, name.encode(), -1))
        return float(self.until(_is_parameter(name)).param_value)

    def set_parameter(self, name: str, value: float) -> float:
        """Write a parameter; gives what it is then."""
        self.send(mavlink.MAVLink_param_set_message(SYSTEM, 1, name.encode(), value, 9))
        return float(self.until(_is_parameter(name)).param_value)

    def ready(self) -> Station:
        """Be armed, in MANUAL, with paddles at stop that stream."""
        self.paddles, self.streams = (1500, 1500), True
        assert self.command(INTERVAL, mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, 20_000) == 0
        self.outputs()
        assert self.command(SET_MODE, 1, MANUAL) == 0
        begin_s = lasting_s = self.now_s
        while True:
            self.heard.clear()
            if (result := self.command(ARM, 1)) == 0:
                return self
            assert result == 4, f"a refusal to arm is MAV_RESULT_FAILED, not {result}"
            self.outputs(settle_s=1.0)
            reasons = self.reasons()
            if any(NEEDS_CALIBRATION in reason for reason in reasons):
                self.calibrate()
            if any(word in reason for word in PASSES for reason in reasons):
                lasting_s = self.now_s
            waited_s, words = self.now_s - begin_s, "; ".join(reasons) or "without a word"
            assert self.now_s - lasting_s < PATIENCE_S, f"it does not arm: {words}"
            assert waited_s < ARMING_LIMIT_S, f"not armed after {ARMING_LIMIT_S} s: {words}"

    def reasons(self) -> list[str]:
        """Give why it did not arm, in its own words."""
        texts = {m.text for m in self.heard if m.get_type() == "STATUSTEXT"}
        return sorted(text for text in texts if text.startswith(("Arm:", "PreArm:")))

    def calibrate(self) -> None:
        """Calibrate the accelerometers in one position, as the boat lies: level and at rest."""
        result = self.command(CALIBRATE, 0, 0, 0, 0, 4, limit_s=CALIBRATION_LIMIT_S)
        assert result == 0, f"the accelerometers could not be calibrated: result {result}"


def override(left: int, right: int) -> Message:
    """Make RC_CHANNELS_OVERRIDE of two paddles."""
    channels = [left, 65535, right] + [65535] * 15
    return mavlink.MAVLink_rc_channels_override_message(SYSTEM, 1, *channels)


def _is_parameter(name: str) -> Callable[[Message], bool]:
    return lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == name
