"""ArduPilot Rover as a twin-thruster boat: a state machine of what it was seen to do.

Measured on ArduRover V4.6.0-dev SITL. No bytes, no clock, no socket: the MAVLink face is
`endpoint`, and time is an argument. Where a rule was read in its sources instead, it says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

from msgspec import field

from twinscrew.hil_sim.autopilot.fences import Fences
from twinscrew.hil_sim.autopilot.mixer import (
    SERVOS,
    THROTTLE_LEFT,
    THROTTLE_RIGHT,
    Mixer,
    in_uint16,
)
from twinscrew.hil_sim.autopilot.parameters import CALIBRATED, SIMULATION, Parameters
from twinscrew.hil_sim.autopilot.radio import LOST_AFTER_S, Radio
from twinscrew.runtime.link.ardupilot.parameters import read_parm
from twinscrew.runtime.settings import NonNegative, Settings

NEUTRAL_AFTER_S = 0.6
"""[s] Overrides stopped, no receiver, FS_THR_ENABLE 1: thrust neutral (measured 0.55 to 0.66 s)."""
FORCE = 21196
"""Param 2 of the arm command that skips the checks (MAV_CMD_COMPONENT_ARM_DISARM)."""


BRAKES_AFTER_S = 1.3
"""[s] In ACRO, with sticks at rest, a boat that has way on goes astern (measured)."""
ASTERN_PER_MPS = 0.3
"""[1/m s] How far, for its speed (ours: the real one's speed controller has gains of its own)."""


class Mode(IntEnum):
    """Rover's mode numbers, `custom_mode` of its heartbeat; those that are simulated."""

    MANUAL = 0
    ACRO = 1
    HOLD = 4
    INITIALISING = 16


class RoverSettings(Settings, frozen=True):
    """How the simulated autopilot is set up."""

    arming_delay_s: NonNegative = 0.0
    """[s] Arming is refused this long after boot. The real one: about 20 s (measured)."""
    initialising_s: NonNegative = 0.0
    """[s] After boot it says INITIALISING so long, and refuses any mode."""
    calibrated: bool = True
    """Whether it has config/autopilot/simulation.parm: calibrated accelerometers. The real one's
    simulator comes without."""
    receiver: bool = False
    """Whether a radio receiver is fitted (then overrides that stop give way to its sticks)."""
    parameters: dict[str, float] = field(default_factory=dict)
    """Parameters that differ from config/autopilot/ardurover.parm, to try a wrong set-up."""


class Rover:
    """The autopilot's state.

    Parameters
    ----------
    settings, system_id
        Its set-up, and its MAVLink system id (SYSID_THISMAV; SYSID_MYGCS starts as the same).
    boot_s
        [s] When it was switched on, in the caller's time.
    """

    def __init__(self, settings: RoverSettings, system_id: int, boot_s: float = 0.0) -> None:
        given = read_parm(SIMULATION) if settings.calibrated else {}
        given["SIM_RC_FAIL"] = 0.0 if settings.receiver else 1.0
        self.parameters = Parameters(system_id, given | settings.parameters)
        self.radio = Radio(receiver=self.parameters["SIM_RC_FAIL"] == 0)
        self.mode = Mode.INITIALISING if settings.initialising_s > 0.0 else Mode.MANUAL
        self.armed = False
        self.fences = Fences()
        self.failsafe = False
        """True while the radio failsafe holds the boat."""
        self.boot_s = boot_s
        self.texts: list[str] = []
        """What it wants to tell (STATUSTEXT); the endpoint takes them out."""
        self.refusal = ""
        """Why it did not arm when it was last asked; empty if it did."""
        self.surge_mps = 0.0
        """[m/s] The boat's speed ahead, which a mode that holds a speed needs."""
        self._mode_s = boot_s
        self._initialised_s = boot_s + settings.initialising_s
        self._arming_delay_s = settings.arming_delay_s
        self._servos = [0] * SERVOS
        self._now_s = boot_s
        self._mixer = Mixer(self.parameters)
        self._mixed_at = self.parameters.changes
        self.propellers = self._mixer.outputs(None)
        """[us] Pulse widths that drive the left and right propeller."""

    @property
    def is_boat(self) -> bool:
        """FRAME_CLASS 2: heartbeats say surface boat."""
        return self.parameters["FRAME_CLASS"] == 2

    def override(self, values: Sequence[int], sender: int, now_s: float) -> None:
        """Take RC_CHANNELS_OVERRIDE; from anyone but SYSID_MYGCS it is silently ignored."""
        if sender == self.parameters["SYSID_MYGCS"] and self.parameters["RC_OVERRIDE_TIME"] != 0:
            self.radio.override(values, now_s)

    def set_mode(self, number: float) -> bool:
        """Change the mode; False if there is none of this number, or it is initialising."""
        if self.mode is Mode.INITIALISING:
            self.texts.append("Flight mode change failed")
            return False
        if number not in (Mode.MANUAL, Mode.ACRO, Mode.HOLD):
            return False
        self.mode, self._mode_s = Mode(int(number)), self._now_s
        self._drive()
        return True

    def arm(self, *, force: bool = False) -> bool:
        """Arm; False, with the reason in `texts`, if a check forbids it."""
        refusal = None if force or self.armed else self._arming_refusal(self._now_s)
        self.refusal = "" if refusal is None else f"Arm: {refusal}"
        if refusal is not None:
            self.texts.append(self.refusal)
            return False
        if not self.armed:
            self.texts.append("Throttle armed")
        self.armed = True
        self._drive()
        return True

    def disarm(self) -> None:
        """Disarm: neutral outputs."""
        if self.armed:
            self.texts.append("Throttle disarmed")
        self.armed = False
        self._drive()

    def calibrate(self) -> bool:
        """Calibrate the accelerometers, the boat being level and at rest; not while it is armed."""
        if self.armed:
            return False
        for name, value in read_parm(SIMULATION).items():
            if name.startswith("INS_"):
                self.parameters.set(name, value)
        return True

    def set_servo(self, number: float, pwm_us: float) -> bool:
        """DO_SET_SERVO: refused on a propeller's output; elsewhere it works even disarmed."""
        if not 1 <= number <= SERVOS or self._wiring().functions[int(number) - 1] != 0:
            return False
        self._servos[int(number) - 1] = in_uint16(pwm_us)
        return True

    def step(self, now_s: float) -> None:
        """Let time pass: channels age, the failsafe watches, the outputs follow."""
        self._now_s = now_s
        if self.mode is Mode.INITIALISING and now_s >= self._initialised_s:
            self.mode, self._mode_s = Mode.MANUAL, now_s
        self.radio.receiver = self.parameters["SIM_RC_FAIL"] == 0
        self.radio.update(now_s, self.parameters["RC_OVERRIDE_TIME"])
        self._watch_radio(now_s)
        self._drive()

    def _watch_radio(self, now_s: float) -> None:
        silent_s = self.radio.silent_s(now_s, self.boot_s)
        watched = self.parameters["FS_THR_ENABLE"] != 0
        if not watched or silent_s <= LOST_AFTER_S:
            if self.failsafe:
                self.texts.append("Radio Failsafe Cleared")
            self.failsafe = False
        elif (
            silent_s > LOST_AFTER_S + self.parameters["FS_TIMEOUT"]
            and not self.failsafe
            and self.mode not in (Mode.HOLD, Mode.INITIALISING)
        ):
            self.failsafe = True
            self.texts.append("Radio Failsafe")
            self.radio.clear_overrides()
            if self.parameters["FS_ACTION"] == 2:
                self.mode = Mode.HOLD  # it stays there: HOLD latches

    def servo_outputs(self) -> list[int]:
        """Give the pulse widths [us] of outputs 1 to 16, as SERVO_OUTPUT_RAW tells them."""
        left, right = self.propellers
        drives = {THROTTLE_LEFT: left, THROTTLE_RIGHT: right}
        functions = self._wiring().functions
        return [
            drives.get(int(function), servo)
            for function, servo in zip(functions, self._servos, strict=True)
        ]

    def _drive(self) -> None:
        lost = (
            self.parameters["FS_THR_ENABLE"] != 0
            and self.radio.silent_s(self._now_s, self.boot_s) > NEUTRAL_AFTER_S
        )
        driven = self.armed and self.mode is Mode.MANUAL and not lost
        if self.armed and self.mode is Mode.ACRO and not lost:
            self.propellers = self._wiring().both(self._speed_hold())
        else:
            self.propellers = self._wiring().outputs(self.radio.values if driven else None)

    def _speed_hold(self) -> float:
        """Give what ACRO makes of sticks at rest: no speed is wanted, so it brakes, astern.

        Nobody moves the sticks in ACRO here: what they would do is not simulated.
        """
        if self._now_s - self._mode_s < BRAKES_AFTER_S:
            return 0.0
        return -ASTERN_PER_MPS * self.surge_mps

    def _wiring(self) -> Mixer:
        if self._mixed_at != self.parameters.changes:
            self._mixer = Mixer(self.parameters)
            self._mixed_at = self.parameters.changes
        return self._mixer

    def _arming_refusal(self, now_s: float) -> str | None:
        if self.mode is Mode.INITIALISING:
            return "Mode not armable"
        if any(self.parameters[name] == 0.0 for name in CALIBRATED):
            return "3D Accel calibration needed"
        if now_s - self.boot_s < self._arming_delay_s:
            return "AHRS: not healthy"
        if self.radio.silent_s(now_s, self.boot_s) > LOST_AFTER_S or not self.radio.values[2]:
            return "Radio failsafe on"
        if abs(self.radio.values[2] - self.parameters["RC3_TRIM"]) > self.parameters["RC3_DZ"] + 1:
            return "Throttle (RC3) is not neutral"  # read: ARMING_CHECK's default
        return None
