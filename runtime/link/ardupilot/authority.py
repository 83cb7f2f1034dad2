"""Who has the boat: ArduPilot's modes, the continuity of its frames, and the state machine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType

# -- ArduPilot Rover's modes by number (`custom_mode` of its heartbeat).


MANUAL = 0
HOLD = 4
INITIALISING = 16

NAMES = {
    0: "MANUAL",
    1: "ACRO",
    3: "STEERING",
    4: "HOLD",
    5: "LOITER",
    6: "FOLLOW",
    7: "SIMPLE",
    8: "DOCK",
    9: "CIRCLE",
    10: "AUTO",
    11: "RTL",
    12: "SMART_RTL",
    15: "GUIDED",
    16: "INITIALISING",
}
"""https://ardupilot.org/rover/docs/rover-control-modes.html, numbers from MAVLink ROVER_MODE."""


def mode_name(number: int | None) -> str:
    """Give a mode's name, "mode 42" for a number without one, "unknown" for None."""
    return "unknown" if number is None else NAMES.get(number, f"mode {number}")


# -- What the frames themselves prove: whether any is missing or late, whether the sender restarted.
#
# Authority rests on knowing that nothing was missed. Two counters in ArduPilot's messages tell it:
# the sequence number of every frame, and the time since boot in many messages. Both are read here,
# without a clock: times are the caller's.

NUMBERS = 256
"""[-] MAVLink's sequence numbers count modulo this."""
LATE_S = 1.0
"""[s] A frame that was overtaken comes at most this long after the one that overtook it. An
autopilot that restarts is silent for longer than twice this."""
LONGEST_GAP_S = 4.0
"""[s] After a longer silence as many as 256 frames may be missing, which no number shows: that is
64 frames a second; an autopilot with our streams sends 20 to 60."""
STEADY_S = 0.5
"""[s] A time since boot proves something only if it is no more than this behind the last one."""


class FrameNumbers:
    """Follows the sequence numbers of one sender."""

    def __init__(self) -> None:
        self._newest = 0
        self._newest_s = -math.inf
        self._missed = False
        self._silent = False

    def arrived(self, number: int, now_s: float) -> bool:
        """Take a frame's number; False if the frame is a copy or came late, and tells nothing."""
        if not math.isfinite(self._newest_s):
            self._newest, self._newest_s = number, now_s
            return True
        ahead = (number - self._newest) % NUMBERS
        since_s = now_s - self._newest_s
        if (ahead == 0 or ahead >= NUMBERS // 2) and since_s < LATE_S:
            return False  # unless the sender began to count anew, which silence shows
        self._missed |= ahead != 1 or since_s > LONGEST_GAP_S
        self._silent |= since_s >= LATE_S
        self._newest, self._newest_s = number, now_s
        return True

    def missed(self) -> tuple[bool, bool]:
        """Tell of the frames since the last call.

        Returns
        -------
        missed
            Whether a frame may be missing.
        broken
            Whether one may be, or there was a silence in which the sender may have restarted.
        """
        missed, broken = self._missed, self._missed or self._silent
        self._missed = self._silent = False
        return missed, broken


class Uptime:
    """Follows the time since boot that messages carry.

    Parameters
    ----------
    wraps_s
        [s] When the counter starts again at 0: 2**32 of its units.
    """

    def __init__(self, wraps_s: float) -> None:
        self._wraps_s = wraps_s
        self._last_s: float | None = None
        self._came_s = -math.inf

    def arrived(self, uptime_s: float, now_s: float) -> bool | None:
        """Take a time since boot [s].

        Returns
        -------
        bool or None
            True: the sender has not restarted since the last message. False: it has. None: this
            is the first message, or came late, and proves nothing.
        """
        last_s, passed_s = self._last_s, now_s - self._came_s
        if last_s is None:
            self._last_s, self._came_s = uptime_s, now_s
            return None
        wrapped = abs(uptime_s + self._wraps_s - (last_s + passed_s)) < STEADY_S
        if not wrapped and last_s - LATE_S <= uptime_s < last_s and uptime_s >= passed_s:
            return None  # older than the last one, and too much to have begun anew since
        self._last_s, self._came_s = uptime_s, now_s
        if wrapped:
            return True
        if uptime_s < last_s or uptime_s < passed_s - STEADY_S:
            return False  # it counts from less than before, or began to count since
        return True if last_s + passed_s - uptime_s <= STEADY_S else None


# -- Who has the boat: a state machine that decides when we drive, and what we ask the autopilot
# for.
#
# It rests on what the autopilot's heartbeats say and on what the numbers of its frames prove
# (`continuity`), never on texts. `TRANSITIONS` is the whole of it; docs/mavlink.md shows the same
# table. Two principles decide every doubtful case: any mode but MANUAL is somebody else's choice,
# and what cannot be told from a pilot's choice is a pilot's choice.
#
# How the radio failsafe's HOLD is told from a pilot's: ArduRover sets its failsafe flag, then
# changes the mode, and sends a heartbeat at once, so that HOLD and MAV_STATE_CRITICAL come
# together. A pilot's HOLD comes with MAV_STATE_STANDBY, unless the state was critical before. So
# HOLD is the failsafe's if the heartbeat before it said MANUAL and was not critical, this one says
# HOLD and is, no frame between them is missing, the parameters say that the failsafe chooses HOLD,
# and for as long as the failsafe takes the autopilot has not shown that it hears us (the state is
# critical after a failure of the navigation filter, too). Sources: ArduPilot's Rover/failsafe.cpp,
# Rover/ekf_check.cpp, Rover/system.cpp, Rover/GCS_Mavlink.cpp.

ASK_SETTLED_S = 5.0
"""[s] A request for MANUAL may act, and its effect be seen, this long after it was sent."""
FAILSAFE_AFTER_S = 1.9
"""[s] The failsafe acts no sooner after the last override: 0.5 s and FS_TIMEOUT, less two periods
of the overrides."""
FAILSAFE_PARAMETERS = ("FS_THR_ENABLE", "FS_ACTION", "FS_TIMEOUT")
"""They must be known to be right, or HOLD is a pilot's."""
_UINT32 = 2.0**32


class AskManual(Enum):
    """When the link may ask for MANUAL mode."""

    NEVER = "never"
    AT_START = "at_start"
    AFTER_FAILSAFE = "after_failsafe"
    """At the start, and when the radio failsafe chose HOLD."""


class Holder(Enum):
    """Who has the boat: the states."""

    NOBODY = "nobody"
    """No heartbeat yet, or only while the autopilot starts."""
    OFFERED = "offered"
    """At first contact it was disarmed and in another mode: we may ask for MANUAL."""
    COMPANION = "companion"
    """MANUAL is ours: we drive when it is armed."""
    FAILSAFE = "failsafe"
    """The radio failsafe chose HOLD: we may ask for MANUAL."""
    PILOT = "pilot"
    """A pilot took it, or may have. We ask for nothing and do not drive."""
    RETURNING = "returning"
    """A pilot's boat is in MANUAL again: is that his choice, or did the autopilot restart?"""


class Input(Enum):
    """What is heard: the inputs."""

    MANUAL = "MANUAL"
    INITIALISING = "INITIALISING"
    FAILSAFE_HOLD = "HOLD by the failsafe"
    UNCHANGED = "unchanged"
    """The mode and arming of the heartbeat before, and nothing of importance can be missing."""
    OTHER_DISARMED = "another mode, disarmed"
    OTHER_ARMED = "another mode, armed"
    GIVEN_BACK = "MANUAL by choice"
    """After another mode, not by a request of ours, and no restart can lie between the two."""
    MAYBE_GIVEN_BACK = "MANUAL by choice or by a restart"
    """The same, but a frame is missing or there was a silence."""
    SAME_START = "no restart"
    """Its time since boot went on."""
    RESTART = "restart"
    """Its time since boot began anew."""
    OPERATOR_MANUAL = "operator's word in MANUAL"
    OPERATOR_OTHER = "operator's word in another mode"


TRANSITIONS: Mapping[tuple[Holder, Input], Holder] = MappingProxyType(
    {
        (Holder.NOBODY, Input.MANUAL): Holder.COMPANION,
        (Holder.NOBODY, Input.OTHER_DISARMED): Holder.OFFERED,
        (Holder.NOBODY, Input.OTHER_ARMED): Holder.PILOT,
        (Holder.OFFERED, Input.MANUAL): Holder.COMPANION,
        (Holder.OFFERED, Input.INITIALISING): Holder.COMPANION,
        (Holder.OFFERED, Input.OTHER_DISARMED): Holder.PILOT,
        (Holder.OFFERED, Input.OTHER_ARMED): Holder.PILOT,
        (Holder.COMPANION, Input.FAILSAFE_HOLD): Holder.FAILSAFE,
        (Holder.COMPANION, Input.OTHER_DISARMED): Holder.PILOT,
        (Holder.COMPANION, Input.OTHER_ARMED): Holder.PILOT,
        (Holder.FAILSAFE, Input.MANUAL): Holder.COMPANION,
        (Holder.FAILSAFE, Input.INITIALISING): Holder.COMPANION,
        (Holder.FAILSAFE, Input.OTHER_DISARMED): Holder.PILOT,
        (Holder.FAILSAFE, Input.OTHER_ARMED): Holder.PILOT,
        (Holder.PILOT, Input.GIVEN_BACK): Holder.COMPANION,
        (Holder.PILOT, Input.MAYBE_GIVEN_BACK): Holder.RETURNING,
        (Holder.RETURNING, Input.SAME_START): Holder.COMPANION,
        (Holder.RETURNING, Input.RESTART): Holder.PILOT,
        (Holder.RETURNING, Input.INITIALISING): Holder.PILOT,
        (Holder.RETURNING, Input.FAILSAFE_HOLD): Holder.PILOT,
        (Holder.RETURNING, Input.OTHER_DISARMED): Holder.PILOT,
        (Holder.RETURNING, Input.OTHER_ARMED): Holder.PILOT,
        **{(holder, Input.OPERATOR_MANUAL): Holder.COMPANION for holder in Holder},
        **{(holder, Input.OPERATOR_OTHER): Holder.OFFERED for holder in Holder},
    }
)
"""What is not in the table changes nothing. In COMPANION, INITIALISING is a restart: MANUAL
afterwards is ours as at the start, any other mode is a pilot's."""


class Authority:
    """Remembers who has the boat; times are the caller's.

    Parameters
    ----------
    ask_manual, arm
        What the configuration permits to ask for.
    """

    def __init__(self, ask_manual: AskManual, *, arm: bool) -> None:
        self._ask_manual = ask_manual
        self._arm = arm
        self.holder = Holder.NOBODY
        self.mode: int | None = None
        """The autopilot's mode; None before the first heartbeat."""
        self.armed = False
        self.was_armed = False
        """True once the boat was armed: from then on disarming is somebody's decision."""
        self.arming_unknown = False
        """True if a request for arming was not answered and frames are missing: the boat may have
        been armed, and disarmed by a pilot. So it is not asked again."""
        self.failsafe_holds = False
        """Whether `FAILSAFE_PARAMETERS` are known to be right."""
        self._critical = False
        self._doubtful = False
        self._restarted = False  # and no heartbeat since: it takes no mode yet
        self._frames = FrameNumbers()
        self._uptimes = {1e-3: Uptime(_UINT32 * 1e-3), 1e-6: Uptime(_UINT32 * 1e-6)}
        self._uptime_known = False
        self._other_mode_seen = False  # in the last heartbeat, and a restart since would be seen
        self._reached_s = -math.inf
        self._asked_s = -math.inf
        self._arming_asked = False

    @property
    def taken(self) -> bool:
        """Whether a pilot has the boat, or may have it."""
        return self.holder in (Holder.PILOT, Holder.RETURNING)

    @property
    def held(self) -> bool:
        """Whether the radio failsafe's HOLD is on."""
        return self.holder is Holder.FAILSAFE

    @property
    def drives(self) -> bool:
        """Whether thrust may act: the boat is ours, armed, in MANUAL."""
        ours = self.holder is Holder.COMPANION and self.mode == MANUAL
        return ours and self.armed and not self._doubtful

    @property
    def asks_manual(self) -> bool:
        """Whether to ask for MANUAL now."""
        if self.mode in (MANUAL, INITIALISING) or self._doubtful or self._restarted:
            return False
        if self.holder is Holder.OFFERED:
            return self._ask_manual is not AskManual.NEVER
        return self.holder is Holder.FAILSAFE and self._ask_manual is AskManual.AFTER_FAILSAFE

    @property
    def asks_arming(self) -> bool:
        """Whether to ask for arming now."""
        ours = self.holder is Holder.COMPANION and self.mode == MANUAL and not self._doubtful
        return self._arm and ours and not (self.was_armed or self.arming_unknown)

    def frame(self, number: int, now_s: float) -> bool:
        """Take the sequence number of a frame; False if the frame must not be used: it is late."""
        if self.mode is None:
            self._frames = FrameNumbers()  # nothing is known yet that could be overtaken
        return self._frames.arrived(number, now_s)

    def heartbeat(self, mode: int, now_s: float, *, armed: bool, critical: bool) -> None:
        """Take what a heartbeat says, from a frame that is not late."""
        missed, broken = (lost or self._doubtful for lost in self._frames.missed())
        if self._arming_asked and missed and not armed:
            self.arming_unknown = True
        if mode == MANUAL:
            heard = self._manual(broken, now_s)
        else:
            heard = self._input(mode, armed, critical, missed, now_s)
        self.mode, self._critical = mode, critical
        self._doubtful = self._restarted = False
        self.note_armed(armed)
        self._other_mode_seen = mode not in (MANUAL, INITIALISING) and self._uptime_known
        self._follow(heard)

    def late_heartbeat(self, mode: int, *, armed: bool) -> None:
        """Take what a heartbeat says, from a frame that is late, or else of a new start.

        If it contradicts what is known, we neither drive nor ask until the next one that counts.
        """
        self._doubtful |= (mode, armed) != (self.mode, self.armed)
        self.was_armed |= armed  # whenever that was

    def uptime(self, counted: int, unit_s: float, now_s: float) -> bool:
        """Take a time since boot of a frame not late; True if it shows that it has restarted.

        Parameters
        ----------
        counted, unit_s
            The time, as 32 bits that count units of 1e-3 s or 1e-6 s.
        """
        same = self._uptimes[unit_s].arrived(counted * unit_s, now_s)
        if same is None:
            return False
        self._uptime_known = same
        self._restarted |= not same
        self._other_mode_seen &= same
        self._follow(Input.SAME_START if same else Input.RESTART)
        return not same

    def reached(self, sent_s: float) -> None:
        """Take proof that a message of ours, sent at a time, was received: it was answered."""
        self._reached_s = max(self._reached_s, sent_s)

    def manual_asked(self, now_s: float) -> None:
        """Note that MANUAL was asked for."""
        self._asked_s = now_s

    def arming_asked(self) -> None:
        """Note that arming was asked for."""
        self._arming_asked = True

    def arming_refused(self) -> None:
        """Note that the autopilot refused to arm: the request did nothing."""
        self._arming_asked = False

    def note_armed(self, armed: bool) -> None:
        """Take word that the boat is armed or not: a heartbeat, or the answer to our request."""
        self.armed = armed
        if armed:
            self.was_armed, self._arming_asked = True, False

    def ask_again(self) -> None:
        """Start over, on an operator's word: ask for MANUAL and arm as at the start."""
        self.was_armed, self.arming_unknown, self._arming_asked = self.armed, False, False
        if self.mode is not None:
            ours = self.mode == MANUAL
            self._follow(Input.OPERATOR_MANUAL if ours else Input.OPERATOR_OTHER)

    def _follow(self, heard: Input) -> None:
        self.holder = TRANSITIONS.get((self.holder, heard), self.holder)

    def _manual(self, broken: bool, now_s: float) -> Input:
        """Tell what a heartbeat in MANUAL means."""
        by_request = now_s - self._asked_s < ASK_SETTLED_S
        if self.holder is not Holder.PILOT or by_request:
            return Input.MANUAL
        if self.mode not in (None, MANUAL, INITIALISING) and not broken:
            return Input.GIVEN_BACK
        return Input.MAYBE_GIVEN_BACK if self._other_mode_seen else Input.MANUAL

    def _input(self, mode: int, armed: bool, critical: bool, missed: bool, now_s: float) -> Input:
        """Tell what a heartbeat in another mode means, from it and the one before it."""
        if mode == INITIALISING:
            return Input.INITIALISING
        at_once = self.mode == MANUAL and not self._critical and mode == HOLD and critical
        unheard_s = now_s - self._reached_s
        unheard = math.isfinite(unheard_s) and unheard_s >= FAILSAFE_AFTER_S
        if at_once and unheard and self.failsafe_holds and not missed:
            return Input.FAILSAFE_HOLD
        unasked = self.holder is Holder.OFFERED and not math.isfinite(self._asked_s)
        if (mode, armed) == (self.mode, self.armed) and (unasked or not missed):
            return Input.UNCHANGED
        return Input.OTHER_ARMED if armed else Input.OTHER_DISARMED
