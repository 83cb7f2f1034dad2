"""What the doctor says of the autopilot: whether it is heard, and each of its parameters."""

from __future__ import annotations

from twinscrew.runtime.app.finding import Finding, fail, ok, warn
from twinscrew.runtime.link.ardupilot.link import AutopilotLink
from twinscrew.runtime.link.ardupilot.parameters import ParameterState
from twinscrew.runtime.mavlink import Refusal

WRITE = "twinscrew doctor --listen 10 --write-params, or load config/autopilot/ardurover.parm"
RESTART = "restart the autopilot: some parameters act from then on only"


KEYS = {
    Refusal.UNSIGNED: "give the autopilot our key: twinscrew signing setup; or leave out ours",
    Refusal.OTHER_KEY: "autopilot.signing_key_file is not the autopilot's key: twinscrew signing",
    Refusal.OLD: "set this machine's clock; the autopilot has its time from GPS",
}


def judge_autopilot(link: AutopilotLink) -> list[Finding]:
    """Say what was heard of the autopilot, and of each parameter that the link depends on."""
    status = link.status
    if not status.connected and status.refusal is not None:
        return [fail("autopilot", f"its frames are {status.refusal.value}", KEYS[status.refusal])]
    if not status.connected and status.old_frames:
        return [fail("autopilot", "it speaks MAVLink 1", "set SERIALn_PROTOCOL to 2")]
    if not status.connected:
        advice = "check the connection string, the cable, and SERIALn_PROTOCOL 2"
        return [fail("autopilot", "nothing is heard", advice)]
    if status.hears_signed and not link.signs:
        found = "it signs what it sends, and refuses what we send unsigned"
        return [fail("autopilot", found, "give its key: autopilot.signing_key_file")]
    found = f"mode {status.mode}, {'armed' if status.armed else 'disarmed'}"
    parameters = [judge_parameter(state) for state in link.parameters]
    if not status.is_boat:
        return [fail("autopilot", f"{found}, no boat", "set FRAME_CLASS to 2"), *parameters]
    return [ok("autopilot", found), *parameters]


def judge_parameter(state: ParameterState) -> Finding:
    """Say what a parameter is, and what it must be."""
    wanted = f"must be {state.wanted:g}"
    if state.missing:
        advice = "this firmware has no such parameter: is it ArduPilot Rover 4.2 or newer?"
        return fail(state.name, f"missing, {wanted}", advice)
    if state.found is None:
        return warn(state.name, f"not answered yet, {wanted}", "listen longer")
    found = f"{state.found:g}, {wanted}"
    if not state.right:
        return fail(state.name, found, WRITE)
    if state.before is not None:
        return warn(state.name, f"{found}; it was {state.before:g} and has been written", RESTART)
    return ok(state.name, found)
