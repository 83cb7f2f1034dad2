"""AIS: what vessels say of themselves, made into reports that the tracker can use.

Sentences of NMEA 0183 come in, from a receiver or from an autopilot that forwards what it hears.
pyais reads them: class A (messages 1, 2, 3, 5), class B (18, 19, 24), aids to navigation (21), base
stations (4). A report says where the antenna was at a second of UTC; what goes to the tracker is
where the middle of the hull is now. Rates and what is "not available": ITU-R M.1371-5.

Everything on this channel can be wrong, and anybody can send it. So each vessel's reports are held
against each other: one that no ship can reach is not used until more agree with it (`ais_jump`);
two places that both go on are two vessels with one number (`ais_duplicate`); positions that
contradict the speed that they come with, or a speed no ship has, are called what they may be
(`ais_spoofed`); what is the own vessel is left out (`ais_own_echo`). Memory and work are bounded.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Final

import numpy as np
from msgspec import Meta

from twinscrew.runtime.datum import Datum, from_datum_N
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.marine import Sentence, decode_sentence
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float64,
    HealthEvent,
    Odometry,
    Tracks,
)
from twinscrew.runtime.safety.events import (
    AIS_DUPLICATE,
    AIS_FLOOD,
    AIS_JUMP,
    AIS_LOST,
    AIS_MALFORMED,
    AIS_OWN_ECHO,
    AIS_SPOOFED,
    AIS_STALE,
    EventKind,
)
from twinscrew.runtime.senses.sense import NOTHING, Heard, OwnAt, Rarely, Sense, SenseSettings
from twinscrew.runtime.settings import Count, NonNegative, Positive
from twinscrew.runtime.tracking.detections import Look, SourceSettings
from twinscrew.runtime.tracking.named import POSITION_ONLY, Report
from twinscrew.runtime.tracking.track import Named

KNOT_MPS: Final = 1852.0 / 3600.0
CLASS_A, CLASS_B, AID, BASE = "A", "B", "aid", "base"
POSITION_KINDS: Final = {
    1: CLASS_A,
    2: CLASS_A,
    3: CLASS_A,
    4: BASE,
    18: CLASS_B,
    19: CLASS_B,
    21: AID,
}
"""Messages with a position, and who sends them."""
STATIC: Final = (5, 19, 21, 24)
"""Messages with a name or dimensions."""
NO_HEADING, NO_COURSE_DEG, NO_SPEED_KN, FASTEST_TOLD_KN = 511, 360.0, 102.3, 102.2
MOST_PARTS, PART_AGE_S = 16, 10.0
"""[-], [s] Messages in parts that are kept until the rest comes."""
SAME_FACES = 3
"""[-] Reports that must agree before a place is believed that the vessel cannot have reached."""
CONTRADICTIONS = 3
"""[-] Reports in a row whose positions contradict their speed."""
SLOW_MPS: Final = 0.5
"""[m/s] Below this a course means nothing."""
AID_RADIUS_M, BARE_RADIUS_M = 1.5, {CLASS_A: 15.0, CLASS_B: 5.0}
"""[m] Of what tells no dimensions."""


SOURCE = SourceSettings(identifies=True, acceleration_psd=0.02, radius_m=5.0)
"""What the tracker must know of AIS."""


class AisSettings(SenseSettings, frozen=True, kw_only=True):
    """How AIS is read, and how far it is believed."""

    topic: ClassVar[str] = "nmea"
    source: ClassVar[SourceSettings] = SOURCE

    datum: Datum | None = None
    """Where the local frame lies on the earth; none: as [autopilot] or [estimation] says."""
    own_mmsi: Annotated[int, Meta(ge=0, le=999_999_999)] = 0
    """The own vessel's number, if it has a transponder; 0: it has none."""
    clock_is_utc: bool = True
    """Whether stamps are UTC: then a report's age follows from the second that it tells."""
    latency_s: NonNegative = 1.0
    """[s] Its age where it does not."""
    sigma_m: Positive = 6.0
    """[m] Standard deviation of positions, on each axis, that claim to be good to 10 m;"""
    coarse_sigma_m: Positive = 15.0
    """[m] of those that do not."""
    velocity_sigma_mps: Positive = 0.4
    """[m/s] Standard deviation of each component of a velocity."""
    max_range_m: Positive = 20_000.0
    """[m] What is farther from the own vessel is not followed."""
    jump_m: Positive = 100.0
    """[m] A position this far from where a vessel can be by now is a jump."""
    fastest_mps: Positive = 40.0
    """[m/s] No vessel is faster."""
    own_echo_m: NonNegative = 15.0
    """[m] Reports this near the own vessel that move as it does are not used: they may be its;"""
    own_echo_s: Positive = 20.0
    """[s] they are, if they do so for so long."""
    most_targets: Count = 300
    """[-] Vessels that are remembered; those heard longest ago are forgotten first."""
    most_per_s: Positive = 100.0
    """[1/s] Sentences that are read; a channel pair carries 75 slots a second."""

    def make(self, name: str) -> Sense:
        """See `SenseSettings`."""
        return Ais(self, name)


@dataclass(slots=True, eq=False)
class Face:
    """One place at which a number is heard; two vessels with one number have two."""

    p_N: Float64
    v_N: Float64 | None
    stamp_ns: int
    count: int = 1
    contradictions: int = 0
    report: PositionReport | None = None


@dataclass(slots=True, eq=False)
class Target:
    """What is known of one number (MMSI)."""

    kind: str
    name: str = ""
    size_m: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """[m] From the antenna to bow, stern, port, starboard; zeros: not told."""
    virtual: bool = False
    """Whether it is an aid to navigation without a body."""
    faces: list[Face] = field(default_factory=list)
    heard_ns: int = 0
    is_stale: bool = False
    with_us_since_ns: int | None = None
    jumps: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionReport:
    """A position report in SI units."""

    p_N: Float64
    """[m] [N] (2,) The antenna, at `stamp_ns`."""
    v_N: Float64 | None
    """[m/s] [N] (2,) Over ground; None: not told."""
    heading: float
    """[rad] [N] NaN: not told."""
    sigma_m: float
    """[m] Standard deviation of the position, on each axis."""
    age_s: float
    """[s] How old it was when it came."""
    interval_s: float
    """[s] How often such a vessel reports."""


class Ais:
    """Follows what every vessel says of itself; a `Sense`."""

    def __init__(self, settings: AisSettings, name: str = "ais") -> None:
        """Begin with nobody heard; imports pyais, which nobody needs who has no AIS."""
        from pyais import decode

        if settings.datum is None:
            raise ValueError("AIS needs a datum: its positions lie on the earth")
        self._decode = decode
        self._settings = settings
        self._datum = settings.datum
        self._name = name
        self._targets: dict[int, Target] = {}
        self._parts: dict[tuple[str, str], tuple[int, dict[int, str]]] = {}
        self._tokens, self._tokens_ns = settings.most_per_s, 0
        self._left_out = self._malformed = 0
        self._looked_ns = 0
        self._rarely = Rarely(60.0)
        self._events: list[HealthEvent] = []

    # -- A `Sense`.

    def take(self, payload: bytes, latest_ns: int, own_at: OwnAt) -> Heard:
        """See `Sense`: a nmea_msgs/Sentence. Sentences that are not of AIS are left alone."""
        sentence = decode_sentence(payload)
        text = sentence.text.strip()
        start = text.find("!")  # a tag block may stand before it
        if start < 0 or text[start + 3 : start + 6] not in ("VDM", "VDO"):
            return NOTHING
        stamp_ns = sentence.stamp_ns or latest_ns
        if not self._may_read(stamp_ns):
            return self._take_events()
        try:
            whole = self._assembled(replace(sentence, text=text[start:]), stamp_ns)
            if whole is None:
                return NOTHING
            message = self._decode(*whole, error_if_checksum_invalid=True).asdict()
            own_report = text[start + 3 : start + 6] == "VDO"
            look = self._understood(message, stamp_ns, own_at, own_report=own_report)
        except Exception as error:  # anybody can send anything, and pyais raises much
            self._malformed += 1
            if self._rarely.allows("malformed", stamp_ns):
                detail = f"{self._malformed} so far, the last: {type(error).__name__}: {error}"
                self._events.append(AIS_MALFORMED.at(stamp_ns, detail))
            return self._take_events()
        return self._take_events(() if look is None else (look,))

    def step(self, stamp_ns: int, *, forgotten: bool) -> Heard:
        """See `Sense`: once a second, note who has fallen silent."""
        looks: list[Look] = []
        if forgotten:
            for mmsi, target in self._targets.items():
                looks += self._all_looks(mmsi, target, stamp_ns)
        if abs(stamp_ns - self._looked_ns) >= NANOSECONDS_PER_SECOND:
            self._looked_ns = stamp_ns
            self._note_the_silent(stamp_ns)
        return self._take_events(tuple(looks))

    def targets(self, stamp_ns: int) -> Tracks | None:
        """See `Sense`: every vessel heard, where it is now by its last report."""
        rows = []
        for mmsi, target in self._targets.items():
            for place, face in enumerate(target.faces):
                if face.report is None or (place > 0 and face.count < SAME_FACES):
                    continue
                age_s = max((stamp_ns - face.stamp_ns) / NANOSECONDS_PER_SECOND, 0.0)
                named = self._named(mmsi, target, face, place)
                p_N = self._middle(target, face) + _moved(face.v_N, age_s)
                rows.append((mmsi, p_N, face, named, age_s, face.report.sigma_m))
        if not rows:
            return None
        covariance = np.array([np.diag([r[5] ** 2] * 2 + [self._v_variance] * 2) for r in rows])
        return Tracks(
            stamp_ns=stamp_ns,
            id=np.array([r[0] for r in rows], np.int64),
            p_N=np.array([r[1] for r in rows]),
            v_N=np.array([np.zeros(2) if r[2].v_N is None else r[2].v_N for r in rows]),
            radius=np.array([self._radius(self._targets[r[0]]) for r in rows]),
            covariance=covariance,
            age_s=np.array([r[4] for r in rows]),
            half_length=np.array([r[3].half_length_m for r in rows]),
            half_beam=np.array([r[3].half_beam_m for r in rows]),
            heading=np.array([r[3].heading for r in rows]),
            name=tuple(r[3].name for r in rows),
        )

    # -- From sentences to messages.

    def _may_read(self, stamp_ns: int) -> bool:
        """Tell whether there is time for one more sentence, by a bucket of tokens."""
        most = self._settings.most_per_s
        dt = max((stamp_ns - self._tokens_ns) / NANOSECONDS_PER_SECOND, 0.0)
        self._tokens = min(self._tokens + dt * most, most)
        self._tokens_ns = stamp_ns
        if self._tokens >= 1.0:
            self._tokens -= 1.0
            return True
        self._left_out += 1
        if self._rarely.allows("flood", stamp_ns):
            detail = f"more than {most:g} sentences a second, {self._left_out} left out so far"
            self._events.append(AIS_FLOOD.at(stamp_ns, detail))
        return False

    def _assembled(self, sentence: Sentence, stamp_ns: int) -> tuple[str, ...] | None:
        """Give all parts of a message once the last has come."""
        fields = sentence.text.split(",")
        if len(fields) != 7:
            raise MessageError(f"{len(fields)} fields, not 7")
        count, number = int(fields[1]), int(fields[2])
        if count == 1:
            return (sentence.text,)
        if not 1 <= number <= count <= 5:
            raise MessageError(f"part {number} of {count}")
        key = (fields[3], fields[4])
        since_ns, parts = self._parts.pop(key, (stamp_ns, {}))
        if number in parts or not 0 <= stamp_ns - since_ns <= PART_AGE_S * NANOSECONDS_PER_SECOND:
            since_ns, parts = stamp_ns, {}
        parts[number] = sentence.text
        if len(parts) == count:
            return tuple(parts[n] for n in sorted(parts))
        while len(self._parts) >= MOST_PARTS:
            del self._parts[next(iter(self._parts))]
        self._parts[key] = since_ns, parts
        return None

    # -- From messages to reports.

    def _understood(
        self, message: Mapping[str, Any], stamp_ns: int, own_at: OwnAt, *, own_report: bool
    ) -> Look | None:
        number, mmsi = int(message["msg_type"]), int(message["mmsi"])
        if number not in POSITION_KINDS and number not in STATIC:
            return None
        if own_report or (self._settings.own_mmsi and mmsi == self._settings.own_mmsi):
            self._own_number(message, number, mmsi, stamp_ns, own_at, own_report=own_report)
            return None
        known = mmsi in self._targets
        kind = POSITION_KINDS.get(number)
        report = None if kind is None else self._report(message, kind, stamp_ns)
        if not known and report is None and number != 5 and number != 24:
            return None
        own = own_at(stamp_ns)
        if report is not None and not self._is_near(report, own):
            return None
        target = self._targets.pop(mmsi, None) or Target(kind or CLASS_A)
        self._targets[mmsi] = target  # the newest last
        while len(self._targets) > self._settings.most_targets:
            del self._targets[next(iter(self._targets))]
        target.heard_ns = stamp_ns
        if number in STATIC:
            _note_static(target, message)
        if kind is None or report is None:
            return self._renamed(mmsi, target, stamp_ns)
        target.kind = kind
        target.is_stale = False
        if kind == BASE or target.virtual:  # ashore; or there is nothing in the water
            target.faces = [Face(report.p_N, None, stamp_ns, report=report)]
            return None
        return self._placed(mmsi, target, report, stamp_ns, own)

    def _report(
        self, message: Mapping[str, Any], kind: str, stamp_ns: int
    ) -> PositionReport | None:
        """Put a position report into SI units, at the time at which it came; None without one."""
        latitude, longitude = float(message["lat"]), float(message["lon"])
        if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
            return None  # 91 and 181: not available
        moves = kind in (CLASS_A, CLASS_B)
        speed_kn = float(message.get("speed", 0.0)) if moves else 0.0
        course_deg = float(message.get("course", NO_COURSE_DEG)) if moves else NO_COURSE_DEG
        told = int(message.get("heading", NO_HEADING)) if moves else NO_HEADING
        v_N: Float64 | None = None
        if not moves:
            v_N = np.zeros(2)
        elif speed_kn < NO_SPEED_KN:
            speed = speed_kn * KNOT_MPS
            if course_deg < NO_COURSE_DEG:
                course = math.radians(course_deg)
                v_N = speed * np.array([math.cos(course), math.sin(course)])
            elif speed < SLOW_MPS:
                v_N = np.zeros(2)
        age_s = self._age_s(int(message.get("second", 60)), stamp_ns) if moves else 0.0
        settings = self._settings
        sigma = settings.sigma_m if message.get("accuracy") else settings.coarse_sigma_m
        position_N = from_datum_N(self._datum, latitude, longitude)[:2]
        return PositionReport(
            p_N=position_N + _moved(v_N, age_s),
            v_N=v_N,
            heading=math.radians(told) if told < 360 else math.nan,
            sigma_m=math.hypot(sigma, settings.velocity_sigma_mps * age_s + 0.02 * age_s**2),
            age_s=age_s,
            interval_s=_interval_s(kind, v_N, message),
        )

    def _age_s(self, second: int, stamp_ns: int) -> float:
        """[s] Give how old a report is, by the second of UTC at which its position was taken."""
        if not self._settings.clock_is_utc or not 0 <= second < 60:
            return self._settings.latency_s
        age_s = (stamp_ns / NANOSECONDS_PER_SECOND - second) % 60.0
        if age_s > 55.0:  # clocks differ a little
            return 0.0
        return age_s if age_s <= 30.0 else self._settings.latency_s

    def _is_near(self, report: PositionReport, own: Odometry | None) -> bool:
        own_N = np.zeros(2) if own is None else own.position_N[:2]
        return float(np.hypot(*(report.p_N - own_N))) <= self._settings.max_range_m

    # -- Is it the vessel that it was?

    def _placed(
        self,
        mmsi: int,
        target: Target,
        report: PositionReport,
        stamp_ns: int,
        own: Odometry | None,
    ) -> Look | None:
        """Hold a report against the vessel's earlier ones; give it as a look if it is believed."""
        if report.v_N is not None and np.hypot(*report.v_N) > self._settings.fastest_mps:
            speed = float(np.hypot(*report.v_N))
            self._tell(AIS_SPOOFED, mmsi, target, stamp_ns, f"a speed of {speed:.0f} m/s")
            return None
        if self._is_with_us(target, report, stamp_ns, own):
            since_s = (stamp_ns - (target.with_us_since_ns or 0)) / NANOSECONDS_PER_SECOND
            if since_s >= self._settings.own_echo_s:
                self._tell(AIS_OWN_ECHO, mmsi, target, stamp_ns, "moves with the own vessel")
            return None
        _forget_old_faces(target, stamp_ns)
        face = self._face_of(target, report, stamp_ns)
        if face is None:
            face = Face(report.p_N, report.v_N, stamp_ns, report=report)
            target.faces.append(face)
            if len(target.faces) > 1:
                self._jumped(mmsi, target, report, stamp_ns)
        else:
            self._check_speed(mmsi, target, face, report, stamp_ns)
            face.p_N, face.v_N, face.report = report.p_N, report.v_N, report
            face.stamp_ns, face.count = stamp_ns, face.count + 1
        place = target.faces.index(face)
        if place > 0:
            if face.count < SAME_FACES:
                return None
            place = self._believed_twice(mmsi, target, face, stamp_ns)
        return self._look(mmsi, target, face, place, stamp_ns)

    def _face_of(self, target: Target, report: PositionReport, stamp_ns: int) -> Face | None:
        """Give the place from which the vessel can have come here; None if there is none."""
        best, least = None, math.inf
        for face in target.faces:
            dt = max((stamp_ns - face.stamp_ns) / NANOSECONDS_PER_SECOND, 0.0)
            off = float(np.hypot(*(report.p_N - face.p_N - _moved(face.v_N, dt))))
            speed = 5.0 if face.v_N is None else float(np.hypot(*face.v_N))
            reach = self._settings.jump_m + min(0.5 * speed + 2.0, 10.0) * dt
            if off <= reach and off < least:
                best, least = face, off
        return best

    def _jumped(self, mmsi: int, target: Target, report: PositionReport, stamp_ns: int) -> None:
        target.jumps += 1
        off = float(np.hypot(*(report.p_N - target.faces[0].p_N)))
        dt = (stamp_ns - target.faces[0].stamp_ns) / NANOSECONDS_PER_SECOND
        self._tell(AIS_JUMP, mmsi, target, stamp_ns, f"{off:.0f} m within {dt:.0f} s: not used yet")
        if target.jumps >= 5:
            where = f"{target.jumps} places that no ship can reach"
            self._tell(AIS_SPOOFED, mmsi, target, stamp_ns, where)

    def _believed_twice(self, mmsi: int, target: Target, face: Face, stamp_ns: int) -> int:
        """Decide what a second place is that has been heard often: another vessel, or the same."""
        first = target.faces[0]
        silent_s = (stamp_ns - first.stamp_ns) / NANOSECONDS_PER_SECOND
        interval_s = 10.0 if first.report is None else first.report.interval_s
        if silent_s > 2.0 * interval_s:
            target.faces = [face]
            target.jumps = 0
            return 0
        where = f"{float(np.hypot(*(face.p_N - first.p_N))):.0f} m apart"
        self._tell(AIS_DUPLICATE, mmsi, target, stamp_ns, f"two vessels with one number, {where}")
        return target.faces.index(face)

    def _check_speed(
        self, mmsi: int, target: Target, face: Face, report: PositionReport, stamp_ns: int
    ) -> None:
        """Hold the way between two reports against the speed that they tell."""
        dt = (stamp_ns - face.stamp_ns) / NANOSECONDS_PER_SECOND
        if report.v_N is None or face.v_N is None or dt < 1.0:
            return
        way_N = (report.p_N - face.p_N) / dt
        told_N = 0.5 * (report.v_N + face.v_N)
        limit = max(3.0, 0.5 * float(np.hypot(*told_N))) + 2.0 * report.sigma_m / dt
        wrong = float(np.hypot(*(way_N - told_N))) > limit
        face.contradictions = face.contradictions + 1 if wrong else 0
        if face.contradictions >= CONTRADICTIONS:
            told, made = float(np.hypot(*told_N)), float(np.hypot(*way_N))
            words = f"says {told:.1f} m/s, but its positions make {made:.1f} m/s"
            self._tell(AIS_SPOOFED, mmsi, target, stamp_ns, words)

    def _is_with_us(
        self, target: Target, report: PositionReport, stamp_ns: int, own: Odometry | None
    ) -> bool:
        """Tell whether a report may be the own vessel's; near by the LiDAR sees for itself."""
        if own is None or report.v_N is None:
            return False
        heading = own.heading
        c, s = math.cos(heading), math.sin(heading)
        surge, sway = own.velocity_B[:2].tolist()
        v_N = np.array([c * surge - s * sway, s * surge + c * sway])
        near = float(np.hypot(*(report.p_N - own.position_N[:2]))) <= self._settings.own_echo_m
        if not near or float(np.hypot(*(report.v_N - v_N))) > 1.0:
            target.with_us_since_ns = None
            return False
        if target.with_us_since_ns is None:
            target.with_us_since_ns = stamp_ns
        return True

    def _own_number(
        self,
        message: Mapping[str, Any],
        number: int,
        mmsi: int,
        stamp_ns: int,
        own_at: OwnAt,
        *,
        own_report: bool,
    ) -> None:
        """Leave out the own vessel; but say so if somebody else uses its number."""
        own, kind = own_at(stamp_ns), POSITION_KINDS.get(number)
        report = None if kind is None else self._report(message, kind, stamp_ns)
        if report is None or own is None or own_report:
            return
        target = Target(CLASS_A, name="own vessel")
        off = float(np.hypot(*(report.p_N - own.position_N[:2])))
        if off > 500.0:
            where = f"the own number is heard {off:.0f} m away"
            self._tell(AIS_DUPLICATE, mmsi, target, stamp_ns, where)
        else:
            self._tell(AIS_OWN_ECHO, mmsi, target, stamp_ns, "the own number: left out")

    # -- From reports to looks.

    def _look(
        self, mmsi: int, target: Target, face: Face, place: int, stamp_ns: int
    ) -> Look | None:
        report = face.report
        if report is None:
            return None
        named = self._named(mmsi, target, face, place)
        sigma = report.sigma_m
        if math.isnan(_towards(report)):  # the antenna may be anywhere on it
            sigma = math.hypot(sigma, 0.5 * max(abs(target.size_m[0] - target.size_m[1]), 0.0))
        doubtful = face.contradictions >= CONTRADICTIONS
        v_N = None if doubtful else report.v_N
        return Look(
            stamp_ns=stamp_ns,
            source=self._name,
            origin_N=np.zeros(2),
            z=self._middle(target, face)[None],
            H=POSITION_ONLY[None],
            R=(sigma**2 * np.eye(2))[None],
            R_rad2=np.zeros(1),
            extras=[Report(named, v_N, self._settings.velocity_sigma_mps)],
        )

    def _renamed(self, mmsi: int, target: Target, stamp_ns: int) -> Look | None:
        """Give the tracker name and size as soon as they are known."""
        if not target.faces or target.kind == BASE or target.virtual:
            return None
        look = self._look(mmsi, target, target.faces[0], 0, stamp_ns)
        if look is None:
            return None
        return replace(look, extras=[replace(look.extras[0], names_only=True)])

    def _all_looks(self, mmsi: int, target: Target, stamp_ns: int) -> Iterable[Look]:
        """Give what is known of a vessel again, where it must be by now."""
        if target.kind == BASE or target.virtual:
            return
        for place, face in enumerate(target.faces):
            if face.report is None or (place > 0 and face.count < SAME_FACES):
                continue
            if stamp_ns > self._named(mmsi, target, face, place).until_ns:
                continue
            look = self._look(mmsi, target, face, place, stamp_ns)
            if look is not None:
                dt = max((stamp_ns - face.stamp_ns) / NANOSECONDS_PER_SECOND, 0.0)
                yield replace(look, z=look.z + _moved(face.v_N, dt), R=look.R + (0.4 * dt) ** 2)

    def _named(self, mmsi: int, target: Target, face: Face, place: int) -> Named:
        bow, stern, port, starboard = target.size_m
        known = bow + stern > 0.0
        report = face.report
        interval_s = 10.0 if report is None else report.interval_s
        identity = f"{mmsi:09d}" if place == 0 else f"{mmsi:09d} ({place + 1})"
        return Named(
            identity=identity,
            name=f"{identity} {target.name}".strip(),
            half_length_m=0.5 * (bow + stern) if known else math.nan,
            half_beam_m=max(0.5 * (port + starboard), 0.5) if known else math.nan,
            radius_m=self._radius(target),
            heading=math.nan if report is None else _towards(report),
            until_ns=face.stamp_ns + round(5.0 * interval_s * NANOSECONDS_PER_SECOND),
        )

    def _radius(self, target: Target) -> float:
        bow, stern, port, starboard = target.size_m
        if bow + stern > 0.0:
            return 0.5 * math.hypot(bow + stern, port + starboard)
        return AID_RADIUS_M if target.kind == AID else BARE_RADIUS_M.get(target.kind, 5.0)

    def _middle(self, target: Target, face: Face) -> Float64:
        """Give the middle of the hull, (2,) [m] [N], from where the antenna is."""
        towards = math.nan if face.report is None else _towards(face.report)
        bow, stern, port, starboard = target.size_m
        if math.isnan(towards) or bow == port == 0.0:  # zeros: the antenna's place is not told
            return face.p_N
        ahead, right = 0.5 * (bow - stern), 0.5 * (starboard - port)
        c, s = math.cos(towards), math.sin(towards)
        to_middle_N = np.array([c * ahead - s * right, s * ahead + c * right])
        middle_N: Float64 = face.p_N + to_middle_N
        return middle_N

    @property
    def _v_variance(self) -> float:
        return self._settings.velocity_sigma_mps**2

    # -- Who has fallen silent.

    def _note_the_silent(self, stamp_ns: int) -> None:
        for mmsi in list(self._targets):
            target = self._targets[mmsi]
            silent_s = (stamp_ns - target.heard_ns) / NANOSECONDS_PER_SECOND
            interval_s = max(
                (f.report.interval_s for f in target.faces if f.report is not None), default=360.0
            )
            if silent_s < -PART_AGE_S:  # the clock was set back: nothing is known of its times
                del self._targets[mmsi]
            elif silent_s > 5.0 * interval_s + 1.0:
                del self._targets[mmsi]
                if target.faces and target.kind in (CLASS_A, CLASS_B):
                    self._tell(AIS_LOST, mmsi, target, stamp_ns, f"silent for {silent_s:.0f} s")
            elif silent_s > 2.0 * interval_s + 2.0 and not target.is_stale and target.faces:
                target.is_stale = True
                if target.kind in (CLASS_A, CLASS_B):
                    self._tell(AIS_STALE, mmsi, target, stamp_ns, f"silent for {silent_s:.0f} s")

    def _tell(self, kind: EventKind, mmsi: int, target: Target, stamp_ns: int, words: str) -> None:
        if self._rarely.allows(f"{kind.name} {mmsi}", stamp_ns):
            who = f"{mmsi:09d} {target.name}".strip()
            self._events.append(kind.at(stamp_ns, f"{who}: {words}"))

    def _take_events(self, looks: tuple[Look, ...] = ()) -> Heard:
        events, self._events = tuple(self._events), []
        return Heard(looks, events)


def _moved(v_N: Float64 | None, dt: float) -> Float64:
    return np.zeros(2) if v_N is None else v_N * dt


def _towards(report: PositionReport) -> float:
    """[rad] Give where a bow points: the heading; else the course of what goes; else NaN."""
    if not math.isnan(report.heading) or report.v_N is None:
        return report.heading
    if float(np.hypot(*report.v_N)) < 1.0:
        return math.nan
    return math.atan2(report.v_N[1], report.v_N[0])


def _interval_s(kind: str, v_N: Float64 | None, message: Mapping[str, Any]) -> float:
    """[s] Give how often a vessel reports. ITU-R M.1371-5, tables 1 and 2, without turns."""
    speed = 0.0 if v_N is None else float(np.hypot(*v_N))
    if kind in (AID, BASE):
        return 180.0 if kind == AID else 10.0
    if kind == CLASS_B:
        return 180.0 if speed < 2.0 * KNOT_MPS else 30.0
    if int(message.get("status", 15)) in (1, 5) and speed < 3.0 * KNOT_MPS:
        return 180.0
    return 10.0 if speed < 14.0 * KNOT_MPS else 6.0


def _note_static(target: Target, message: Mapping[str, Any]) -> None:
    name = str(message.get("shipname", message.get("name", ""))).strip(" @")
    if name:
        target.name = "".join(c if c.isprintable() else "?" for c in name)[:40]
    target.virtual = bool(message.get("virtual_aid", target.virtual))
    size = [
        float(message.get(f"to_{side}", 0) or 0) for side in ("bow", "stern", "port", "starboard")
    ]
    if size[0] + size[1] > 0.0:
        bow, stern, port, starboard = size
        target.size_m = (bow, stern, port, starboard)


def _forget_old_faces(target: Target, stamp_ns: int) -> None:
    """Forget second places that were not heard again, and keep at most two of them."""
    kept = [
        face
        for place, face in enumerate(target.faces)
        if place == 0
        or abs(stamp_ns - face.stamp_ns)
        <= 5.0 * (30.0 if face.report is None else face.report.interval_s) * 1e9
    ]
    target.faces = [*kept[:1], *kept[1:][-2:]]
