"""The names of health events: what happened, how bad it is, what the boat does about it.

Scripts and operators rely on these names. docs/safety.md tells each one's reaction and time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from twinscrew.runtime.messages.types import HealthEvent, Severity

GREATEST_DETAIL: Final = 500
"""[-] Letters of an event's detail. What a message says of itself (names of fields, frames) may
end up in one, and everything that carries events has a greatest length of its own."""


@dataclass(frozen=True, slots=True)
class EventKind:
    """A kind of health event."""

    name: str
    severity: Severity
    meaning: str

    def at(self, stamp_ns: int, detail: str = "") -> HealthEvent:
        """Make the event of this kind that happened at a time.

        Parameters
        ----------
        stamp_ns
            [ns] When.
        detail
            What there is to say about it; cut to `GREATEST_DETAIL` letters, and what UTF-8 cannot
            write is replaced by question marks.
        """
        return HealthEvent(
            stamp_ns=stamp_ns, name=self.name, severity=self.severity, detail=_printable(detail)
        )


def _printable(detail: str) -> str:
    if len(detail) > GREATEST_DETAIL:
        detail = detail[: GREATEST_DETAIL - 4] + " ..."
    return detail.encode("utf-8", errors="replace").decode("utf-8")


def _info(name: str, meaning: str) -> EventKind:
    return EventKind(name, Severity.INFO, meaning)


def _warning(name: str, meaning: str) -> EventKind:
    return EventKind(name, Severity.WARNING, meaning)


def _error(name: str, meaning: str) -> EventKind:
    return EventKind(name, Severity.ERROR, meaning)


LIDAR_STALE = _error("lidar_stale", "No scan that can be used for too long: neutral thrust.")
ODOMETRY_STALE = _error("odometry_stale", "No new odometry for too long: neutral thrust.")
INPUT_RECOVERED = _info("input_recovered", "A stale input is fresh again.")
ODOMETRY_JUMP = _error(
    "odometry_jump", "The position moved faster than a boat can: all is forgotten, neutral thrust."
)
ODOMETRY_MISSING = _warning(
    "odometry_missing", "A scan came without odometry near its time: it is not used."
)
CLOCK_BACK = _error(
    "clock_back", "The inputs' time went back: all is forgotten, neutral thrust for a while."
)
INPUT_FROZEN = _warning("input_frozen", "A sensor repeats what it said before: no sign of life.")
INPUT_LATE = _warning("input_late", "A scan is too much older than the odometry: it is not used.")
TRACKS_FORGOTTEN = _warning(
    "tracks_forgotten", "The scans' time jumped: what is around is looked for, neutral thrust."
)
OUT_OF_ORDER = _warning("out_of_order", "A message older than the last one is dropped.")
BAD_MESSAGE = _warning("bad_message", "Bytes that are not the message they should be: dropped.")
POLICY_ERROR = _error("policy_error", "The policy failed or answered nonsense: neutral thrust.")
PERCEPTION_ERROR = _error("perception_error", "A scan could not be processed: neutral thrust.")
GUARD_TRIPPED = _error("guard_tripped", "A thrust was not finite or out of range: neutral thrust.")
ASSURANCE_INTERVENED = _warning(
    "assurance_intervened", "The command led to contact: a manoeuvre took its place."
)
ASSURANCE_RELEASED = _info("assurance_released", "The policy has the propellers again.")
INTERNAL_ERROR = _error("internal_error", "A fault of the runtime itself: neutral thrust.")
GOAL_MISSING = _info("goal_missing", "There is no goal: neutral thrust.")
GOAL_SET = _info("goal_set", "A new goal was accepted.")
GOAL_FRAME = _warning(
    "goal_frame", "A goal is in a frame whose place is not known: it is not taken."
)
GOAL_FORBIDDEN = _warning(
    "goal_forbidden",
    "A goal is on land, in water too shallow, or beyond a fence: it is not taken, or taken back.",
)
CHART_CHANGED = _info("chart_changed", "What is fixed around the boat is known anew: its features.")
PLACE_FORBIDDEN = _warning(
    "place_forbidden", "The boat is where the chart or a fence forbids it to be; told at entry."
)
PLACE_ALLOWED = _info("place_allowed", "The boat is where it may be again.")
FENCES_REFUSED = _warning(
    "fences_refused", "Fences that came cannot be honoured: those before them stay."
)
ROUTE_FOUND = _info(
    "route_found", "A way around what is fixed leads to the goal: its length, its legs."
)
ROUTE_MISSING = _warning("route_missing", "No way leads to the goal: the boat holds its place.")
WAYPOINT_REACHED = _info("waypoint_reached", "A waypoint is reached; the next one is the goal.")
GOAL_REACHED = _info("goal_reached", "The last goal is reached: neutral thrust.")
STATION_SET = _info("station_set", "A place to hold was accepted.")
STATION_HELD = _info("station_held", "The vessel is at the place that it is to hold.")
STATION_LEFT = _warning(
    "station_left", "The vessel was driven off the place that it holds; it goes back."
)
STATION_HEADING = _warning(
    "station_heading",
    "The hull cannot hold the heading that was asked for in this wind or current.",
)
STATION_REFUSED = _warning(
    "station_refused", "A place to hold, or a berth, cannot be one: the order before it counts."
)
BERTH_SET = _info("berth_set", "A berth was accepted.")
BERTH_APPROACH = _info("berth_approach", "The vessel begins its way in to the berth.")
BERTHED = _info("berthed", "The vessel lies alongside: neutral thrust, make fast.")
BERTH_ABORTED = _warning(
    "berth_aborted", "The way in to the berth went wrong: it stands off, and tries again."
)
BERTH_GIVEN_UP = _warning(
    "berth_given_up", "Every try to come alongside went wrong: it holds its place off the berth."
)
TRIAL_BEGUN = _info("trial_begun", "A trial has begun, within the box of water that is named.")
TRIAL_MANOEUVRE = _info("trial_manoeuvre", "The trial goes on to the manoeuvre that is named.")
TRIAL_DONE = _info("trial_done", "The trial was sailed to its end: neutral thrust.")
TRIAL_REFUSED = _warning(
    "trial_refused", "The trial did not begin: the boat is outside its box, or a track is near."
)
TRIAL_OUT_OF_BOX = _warning(
    "trial_out_of_box", "The boat left the trial's box: it brakes, then neutral thrust."
)
TRIAL_TOO_FAST = _warning(
    "trial_too_fast", "The boat is faster than the trial allows: it brakes, then neutral thrust."
)
TRIAL_TRACK_NEAR = _warning(
    "trial_track_near", "A track comes near the boat on trial: it brakes, then neutral thrust."
)
TRIAL_INTERRUPTED = _warning(
    "trial_interrupted",
    "Somebody else drives, an order came, or the surroundings are unknown: the trial has ended.",
)
OVERRUN = _warning(
    "overrun", "A decision took longer than the time between two scans, or a tick was missed."
)
PRIORITY_REFUSED = _info(
    "priority_refused", "The system does not give the priority or the cores that were asked for."
)
FILES_APPROVED = _info("files_approved", "Every file that was read agrees with the manifest.")
NAME_TAKEN = _warning(
    "name_taken", "Another runtime of the same name is on the bus: orders reach both boats."
)
STATE = _info("state", "The vessel's state changed.")
STATE_NOW = _info("state_now", "Which state the vessel is in; told every second.")
AUTOPILOT_NOW = _info(
    "autopilot_now", "The autopilot's mode, whether it is armed, its battery; told every second."
)
ENVELOPE_NOW = _info(
    "envelope_now", "The response, and each quantity of the envelope that is known; every second."
)
ENVELOPE_LEFT = _warning("envelope_left", "A quantity is beyond what the boat was proved for.")
ENVELOPE_RETURNED = _info("envelope_returned", "A quantity is well inside the envelope again.")
FALLBACK = _warning("fallback", "The fallback response of the boat changed; with the reasons.")
THRUST_ENABLED = _info("thrust_enabled", "The enable came: decisions drive the thrusters.")
THRUST_DISABLED = _info("thrust_disabled", "The enable was taken back: neutral thrust at once.")
ENABLE_LOST = _warning("enable_lost", "The enable does not come any more: neutral thrust.")
ENABLE_REFUSED = _warning(
    "enable_refused", "An enable came, but nobody consented at the start: neutral thrust."
)
KEEPER = _warning(
    "keeper", "The process that stops the thrusters after the runtime had died: started again."
)
LINK_DOWN = _error(
    "link_down", "The connection to the autopilot broke: it is opened again, neutral thrust."
)
LINK_RESTORED = _info("link_restored", "The connection to the autopilot is open again.")
RECEIVER_DOWN = _warning(
    "receiver_down", "A line that NMEA sentences come by broke: it is opened again."
)
AIS_STALE = _info("ais_stale", "A vessel has missed two of its AIS reports.")
AIS_LOST = _info("ais_lost", "A vessel has been silent on AIS for too long: it is forgotten.")
AIS_JUMP = _warning(
    "ais_jump", "AIS reports a vessel where it cannot be: not used until more reports agree."
)
AIS_SPOOFED = _warning(
    "ais_spoofed", "AIS reports contradict each other, or what the LiDAR sees: do not trust them."
)
AIS_DUPLICATE = _warning("ais_duplicate", "Two vessels report themselves under one MMSI.")
AIS_OWN_ECHO = _info("ais_own_echo", "AIS reports of the own vessel are left out.")
AIS_FLOOD = _warning("ais_flood", "More AIS sentences than the channel carries: some are left out.")
AIS_MALFORMED = _warning("ais_malformed", "AIS sentences that cannot be read are left out.")
COLLISION_COURSE = _warning(
    "collision_course", "A vessel comes too near on present courses: closest approach, and when."
)
COLLISION_COURSE_OVER = _info(
    "collision_course_over", "A vessel that was on a collision course will pass clear."
)
MESSAGES_MISSING = _warning(
    "messages_missing", "Messages were too large, or lost on their way: they are missing."
)
RECORDER = _warning("recorder", "The recorder lost messages or stopped; the boat goes on.")

# The autopilot link (docs/mavlink.md tells what each one means)
AUTOPILOT_SILENT = _error("autopilot_silent", "Nothing comes from the autopilot: neutral thrust.")
AUTOPILOT_DISARMED = _error(
    "autopilot_disarmed", "The autopilot was disarmed; only an operator arms again."
)
MODE_TAKEN = _warning("mode_taken", "A pilot chose another mode: he has the boat until MANUAL.")
FAILSAFE_HOLD = _error("failsafe_hold", "The autopilot's radio failsafe holds the boat.")
OVERRIDE_IGNORED = _error("override_ignored", "The outputs do not follow the commands.")
ARMING_REFUSED = _warning("arming_refused", "The autopilot refuses to arm.")
ARMING_WITHHELD = _warning(
    "arming_withheld", "No operator has given consent: the autopilot is not asked to arm."
)
MODE_REFUSED = _warning("mode_refused", "The autopilot refuses MANUAL.")
WRONG_VEHICLE = _error("wrong_vehicle", "What answers is no ArduPilot boat: neutral thrust.")
PARAMETERS_WRONG = _warning("parameters_wrong", "Autopilot parameters are not what they must be.")
PARAMETERS_UNSAFE = _error(
    "parameters_unsafe",
    "Autopilot parameters on which safety rests are wrong: no driving, no arming.",
)
STREAM_SLOW = _warning("stream_slow", "A message of the autopilot comes too seldom.")
PARAMETERS_WRITTEN = _info("parameters_written", "Autopilot parameters were put right.")
MESSAGE_UNSENT = _warning(
    "message_unsent", "A message could not be written for the line: left out."
)
AUTOPILOT_RECOVERED = _info("autopilot_recovered", "A condition of the autopilot link is over.")
AUTOPILOT_SAYS = _info("autopilot_says", "The autopilot's own words.")

OF_THE_AUTOPILOT: Final = frozenset(
    kind.name
    for kind in (
        AUTOPILOT_SILENT,
        AUTOPILOT_DISARMED,
        MODE_TAKEN,
        FAILSAFE_HOLD,
        OVERRIDE_IGNORED,
        ARMING_REFUSED,
        ARMING_WITHHELD,
        MODE_REFUSED,
        WRONG_VEHICLE,
        PARAMETERS_WRONG,
        PARAMETERS_UNSAFE,
        STREAM_SLOW,
        PARAMETERS_WRITTEN,
        MESSAGE_UNSENT,
        AUTOPILOT_RECOVERED,
        AUTOPILOT_SAYS,
    )
)
"""The names of those that tell of the autopilot link."""

# The estimation of odometry from GPS and IMU (docs/estimation.md)
ESTIMATE_READY = _info("estimate_ready", "Position and heading are known well enough to sail by.")
GPS_LOST = _warning(
    "gps_lost", "No fix that can be used for too long: the estimate coasts; told every second."
)
GPS_BACK = _info("gps_back", "Fixes are used again.")
GPS_DISAGREES = _warning(
    "gps_disagrees", "Fixes lay too far from the estimate for too long: it starts from them anew."
)
HEADING_UNKNOWN = _error("heading_unknown", "The IMU tells no attitude: there is no odometry.")
ESTIMATE_LOST = _error("estimate_lost", "The position is too uncertain: there is no odometry.")
IMU_GAP = _warning("imu_gap", "The IMU was silent for too long: the estimate starts anew.")


KINDS: Final = {kind.name: kind for kind in list(globals().values()) if isinstance(kind, EventKind)}
"""Every kind of event, by name."""
