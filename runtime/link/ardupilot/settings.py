"""The settings of the link to the autopilot."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta, field
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.datum import Datum
from twinscrew.runtime.errors import one_of
from twinscrew.runtime.link.ardupilot.authority import AskManual
from twinscrew.runtime.link.ardupilot.thrust import PaddleSettings
from twinscrew.runtime.link.autopilot import AUTOPILOTS
from twinscrew.runtime.settings import NonNegative, Positive, Settings

Id = Annotated[int, Meta(ge=1, le=255)]
Microseconds = Annotated[int, Meta(ge=1)]
SafetyParameter = Literal[
    "FS_THR_ENABLE", "FS_ACTION", "RC_OVERRIDE_TIME", "SYSID_MYGCS", "MAV_GCS_SYSID"
]


class AutopilotSettings(Settings, frozen=True):
    """The autopilot, and the link to it.

    A kind other than ArduPilot reads connection, wait_s and its own options, and says what it makes
    of the rest.
    """

    kind: str = "ardupilot"
    """Which autopilot it is; a name in `runtime/link/autopilot.py`."""
    options: dict[str, Any] = field(default_factory=dict)
    """What is particular to another kind than ArduPilot."""
    connection: str = "udpin:127.0.0.1:14550"
    """udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD."""
    wait_s: NonNegative = 0.0
    """[s] How long to wait at the start for a TCP server or a device that is not there yet."""
    system_id: Id = 1
    """[-] The vehicle's MAVLink system id, which we share; SYSID_MYGCS must be the same."""
    component_id: Id = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
    """[-] 191: onboard computer."""
    arm: bool = False
    """Ask the autopilot to arm, once; `twinscrew run` does so after `twinscrew consent` only.
    Without it somebody else arms the boat."""
    consent_file: str = ""
    """File by which an operator gives consent to arm; whoever runs the boat must be able to delete
    it. Empty: beside this file, with ".arm" behind its name."""
    ask_manual: AskManual = AskManual.AFTER_FAILSAFE
    """When to ask for MANUAL mode: never, at_start, after_failsafe (which includes at_start)."""
    receiver_fitted: bool = True
    """A pilot's radio receiver is fitted: let go of the channels when he takes the boat."""
    control: Literal["rc_override", "manual_control"] = "rc_override"
    """The message that carries thrust."""
    paddles: PaddleSettings = PaddleSettings()
    check_parameters: bool = True
    """Read the parameters that the link depends on, and say which are wrong. False: only those on
    which safety rests, which are always read."""
    accept_parameters: tuple[SafetyParameter, ...] = ()
    """Parameters on which safety rests that may have other values, or be missing: FS_THR_ENABLE,
    FS_ACTION, RC_OVERRIDE_TIME, SYSID_MYGCS (MAV_GCS_SYSID). Any other one that is wrong, missing
    or not read yet forbids driving and arming."""
    write_parameters: bool = False
    """Write the wrong ones."""
    servo_output_hz: Positive = 10.0
    """[Hz] How often to hear what drives the propellers."""
    state_hz: NonNegative = 0.0
    """[Hz] How often to hear position and attitude; 0 if odometry comes from elsewhere."""
    state_message: Literal["local_position", "odometry"] = "local_position"
    """Which messages tell them: LOCAL_POSITION_NED and ATTITUDE, as ArduPilot sends them, or
    ODOMETRY (331)."""
    datum: Datum | None = None
    """latitude_deg and longitude_deg of the local frame's origin; none: where the autopilot's own
    filter began. Only for odometry from the autopilot."""
    silent_after_s: Positive = 0.5
    """[s] Nothing for this long: the autopilot is silent (once its streams come at their rates)."""
    heartbeat_timeout_s: Positive = 3.5
    """[s] No heartbeat for this long: the autopilot is silent."""
    obey_tolerance_us: Microseconds = 5
    """[us] How far outputs may differ from commands (measured: 1 us)."""
    obey_delay_s: Positive = 0.5
    """[s] How old a command the outputs may still show."""
    obey_patience_s: Positive = 0.5
    """[s] How long outputs may differ before the link says so."""
    signing_key_file: str = ""
    """File of the signing key, readable by its owner only; empty for no signing."""

    def __post_init__(self) -> None:
        """Refuse a kind that nobody knows, and what another kind would not read."""
        if self.kind not in AUTOPILOTS:
            raise ValueError(f"kind: {one_of(self.kind, AUTOPILOTS)}")
        if self.kind == "ardupilot" and self.options:
            raise ValueError("options are another kind's: ArduPilot has keys of its own")
