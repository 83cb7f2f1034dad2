"""Judge B: the text of the rules as formulas of signal temporal logic, which `rtamt` evaluates.

Written from the International Regulations for Preventing Collisions at Sea 1972, rules 7, 8 and 13
to 17, and blind to judge A: the two share tracks and nothing that computes. Where A goes by courses
over ground, B goes by what a lookout sees: relative bearings and aspects, by the vessels' headings
(and by courses where rule 14 says "courses"). Signals are made of complex positions (north + i
east); every formula below stands beside the words of the rule that it says.

The rules give no numbers but 22.5 degrees. Those that a formula needs are in `TemporalSettings`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.rules.evidence import STEP_S, Body, Finding, Role, Tracks
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Positive, Settings

Complex = NDArray[np.complex128]
Signals = Mapping[str, Float64]
FAR = 1e3
"""What a signal is where it has no value: farther, later, more than any threshold."""


class TemporalSettings(Settings, frozen=True, kw_only=True):
    """What the rules leave to the mariner. Lengths are those of the vessel that is judged."""

    in_sight: Positive = 12.0
    """[lengths] Rule 11: vessels in sight of one another."""
    too_near: Positive = 1.0
    """[lengths] Rule 7: a predicted distance between hulls below this is a risk of collision."""
    ahead_s: Positive = 20.0
    """[s] Rule 7: what is to happen later is no risk yet."""
    clear: Positive = 0.2
    """[lengths] Rules 8 (d), 16: passing at a safe distance, well clear."""
    nearly_deg: Positive = 22.5
    """[deg] Rule 14: "reciprocal or nearly reciprocal", "ahead or nearly ahead"."""
    holds_deg: Positive = 15.0
    """[deg] Rule 17 (a): within this a course is kept,"""
    holds_share: Positive = 0.3
    """[-] and within this share, below, or half as much again, above, a speed."""
    apparent_s: Positive = 8.0
    """[s] Rule 17 (a) ii: so near in time, no action of the other is no appropriate action."""
    large_deg: Positive = 30.0
    """[deg] Rule 8 (b): readily apparent to another vessel,"""
    large_share: Positive = 0.5
    """[-] or this share of the speed taken off;"""
    ample_s: Positive = 4.0
    """[s] rule 8 (a): in ample time, before the two are nearest."""


DEFAULT = TemporalSettings()

# Rule 7 (a), (d): a vessel that stays on a course that leads too near, soon, and makes way.
RISK = """always[0:1s]((range <= in_sight) and (miss <= too_near) and (time_to >= 0) and
(time_to <= ahead) and (own_speed >= 0.5) and (their_speed >= 0.5) and (under_way >= 0))"""
# Rule 8 (d): "until the other vessel is finally past and clear".
PAST = "always[0:2s](opening > 0)"
# Rule 13 (b): "coming up with another vessel from a direction more than 22.5 degrees abaft her
# beam".
OVERTAKES = "(aspect > 112.5) and (own_speed > their_speed)"
OVERTAKEN = "(abs_bearing > 112.5) and (their_speed > own_speed)"
# Rule 14 (a), (b): "on reciprocal or nearly reciprocal courses", "sees the other ahead or nearly
# ahead".
HEAD_ON = "(reciprocal <= nearly) and (abs_bearing <= nearly) and (aspect <= nearly)"
# Rule 15: "the vessel which has the other on her own starboard side".
ON_STARBOARD = "(bearing > 0) and (abs_bearing <= 112.5)"
ON_PORT = "(bearing <= 0) and (abs_bearing <= 112.5)"
# Rules 13 (a), 16: "shall keep out of the way", "keep well clear".
KEEPS_CLEAR = "always((gap >= clear) and (contact < 0.5))"
# Rule 14 (a): "so that each shall pass on the port side of the other".
PASSES_PORT = """always(((nearest > 0.5) implies (bearing <= 0)) and (contact < 0.5)) and
always((before > 0.5) implies (turned >= minus_holds))"""
# Rule 15: "avoid crossing ahead of the other vessel".
NOT_AHEAD = "always((prev(beyond <= 0) and (beyond > 0)) implies (along <= 0))"
# Rule 17 (a) i, ii: "keep her course and speed", until "it becomes apparent ... that the vessel
# required to keep out of the way is not taking appropriate action", or the danger is over.
HOLDS = "((abs_turned <= holds) and (slower <= slow_share) and (faster <= 0.5))"
STANDS_ON = f"""always(contact < 0.5) and
((always{HOLDS}) or ({HOLDS} until (released > 0.5)))"""
# Rule 17 (a) ii: they have not altered, and it is late.
APPARENT = """(held_miss <= too_near) and (held_time >= 0) and (held_time <= apparent)"""
# The danger has gone though the vessel stood on.
OVER = "always[0:2s]((held_miss > too_near) or (held_time < 0) or (held_time > ahead))"
# Rule 17 (c): "not alter course to port for a vessel on her own port side".
NOT_TO_PORT = "always(((late > 0.5) and (before > 0.5)) implies (turned >= minus_holds))"
# Rule 8 (a), (b): "made in ample time", "large enough to be readily apparent".
READABLE = """eventually((ample > 0.5) and ((abs_turned >= 10) or (slower >= slow_share)) and
eventually[0:5s](((abs_turned >= large) or (slower >= large_share)) and (before > 0.5)))"""


def available() -> bool:
    """Tell whether `rtamt` is installed."""
    try:
        _rtamt()
    except ConfigError:
        return False
    return True


@lru_cache
def _rtamt() -> Any:
    """Give the library; its parser's runtime uses what Python 3.13 no longer has."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            import rtamt
    except ImportError as error:
        raise ConfigError(
            f"the second judge needs rtamt ({error}): pip install 'twinscrew[judge]', Python 3.11 "
            "or 3.12",
            key="judge",
        ) from error
    return rtamt


@lru_cache(maxsize=256)
def _monitor(formula: str, names: tuple[str, ...], values: tuple[tuple[str, float], ...]) -> Any:
    """Give a parsed formula over signals, its settings filled in."""
    specification = _rtamt().StlDiscreteTimeSpecification()
    for name in names:
        specification.declare_var(name, "float")
    for name, value in values:
        specification.declare_const(name, "float", str(float(value)))
    specification.declare_var("verdict", "float")
    specification.spec = "verdict = " + formula.replace("\n", " ")
    specification.set_sampling_period(round(1000 * STEP_S), "ms", 0.1)
    specification.parse()
    return specification


def robustness(formula: str, signals: Signals, values: Mapping[str, float]) -> Float64:
    """Give a formula's robustness at every sample: not negative where it holds.

    Parameters
    ----------
    formula
        Of signal temporal logic, as `rtamt` writes it.
    signals
        (T,) each, by name.
    values
        Constants of the formula, by name.
    """
    words = set(_words(formula))
    names = tuple(sorted(words & set(signals)))
    used = tuple(sorted((name, value) for name, value in values.items() if name in words))
    data: dict[str, list[float]] = {name: signals[name].tolist() for name in names}
    count = len(data[names[0]])
    data["time"] = list(range(count))
    monitor = _monitor(formula, names, used)
    rows = monitor.evaluate(data)
    return np.array([value for _, value in rows], np.float64)


def _words(formula: str) -> Iterator[str]:
    word = ""
    for letter in formula + " ":
        if letter.isalnum() or letter == "_":
            word += letter
        elif word:
            yield word
            word = ""


@dataclass(frozen=True, slots=True)
class _Seen:
    """What one vessel sees of another in an episode, T samples."""

    own: Complex
    theirs: Complex
    own_v: Complex
    their_v: Complex
    own_bow: Complex
    """Unit numbers along the headings."""
    their_bow: Complex
    hulls: tuple[Body, Body]


def judge(tracks: Tracks, settings: TemporalSettings = DEFAULT) -> tuple[Finding, ...]:
    """Give what every vessel of ours did in its meetings, ordered by their beginnings.

    Raises
    ------
    ConfigError
        `rtamt` is not installed.
    """
    _rtamt()
    found: list[Finding] = []
    for ego, hull in enumerate(tracks.bodies):
        if hull.ours:
            for other in range(len(tracks.bodies)):
                if other != ego:
                    found.extend(_pair(tracks, ego, other, settings))
    return tuple(sorted(found, key=lambda one: (one.begin_s, one.ego, one.other)))


def _pair(tracks: Tracks, ego: int, other: int, settings: TemporalSettings) -> Iterator[Finding]:
    whole = tracks.pose_N[:, [ego, other]]
    there = np.isfinite(whole).all(axis=(1, 2))
    hulls = tracks.bodies[ego], tracks.bodies[other]
    ends = [hull.ended_s for hull in hulls if hull.ended_s is not None]
    there &= tracks.times <= min(ends, default=math.inf)
    for first, last in _stretches(there):
        if last - first > round(3.0 / STEP_S):
            pose = whole[first:last]
            yield from _meetings(tracks, (ego, other), pose, first, settings)


def _stretches(flags: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    yield from ((first, last) for first, last in edges.reshape(-1, 2).tolist())


def _speed(z: Complex) -> Complex:
    """Give smoothed velocities: a straight line through the second around each sample."""
    half = round(0.5 / STEP_S)
    offsets = np.arange(-half, half + 1)
    weights = offsets / (offsets**2).sum() / STEP_S
    padded = np.concatenate([2 * z[0] - z[half:0:-1], z, 2 * z[-1] - z[-2 : -half - 2 : -1]])
    moved: Complex = np.convolve(padded, weights[::-1], "valid")
    return moved


def _seen(pose: Float64, hulls: tuple[Body, Body]) -> _Seen:
    z = pose[..., 0] + 1j * pose[..., 1]
    bow = np.exp(1j * pose[..., 2])
    return _Seen(z[:, 0], z[:, 1], _speed(z[:, 0]), _speed(z[:, 1]), bow[:, 0], bow[:, 1], hulls)


def _degrees(z: Complex) -> Float64:
    angle: Float64 = np.degrees(np.angle(z))
    return angle


def _size(hull: Body) -> float:
    """[m] Give how far from its middle a hull reaches, all round."""
    if hull.circle:
        return 0.5 * abs(complex(hull.length_m, hull.beam_m))
    return 0.25 * (hull.length_m + hull.beam_m)


def _predicted(
    between: Complex, drift: Complex, hulls: tuple[Body, Body]
) -> tuple[Float64, Float64]:
    """Give in which time [s] two pass, and how far apart the hulls then are [m]."""
    rate = np.maximum(np.abs(drift) ** 2, 1e-9)
    until = -(between * drift.conj()).real / rate
    miss = np.abs((between * drift.conj()).imag) / np.sqrt(rate) - _size(hulls[0]) - _size(hulls[1])
    return np.clip(until, -FAR, FAR), np.clip(miss, -FAR, FAR)


def _lookout(seen: _Seen, since_s: Float64) -> dict[str, Float64]:
    """Give what can be seen at every sample, by the names of the formulas."""
    between = seen.theirs - seen.own
    time_to, miss = _predicted(between, seen.their_v - seen.own_v, seen.hulls)
    distance = np.abs(between)
    bearing = _degrees(between / seen.own_bow)
    behind = -between / seen.their_bow  # ourselves, seen from their bow
    return {
        "range": distance,
        "opening": np.gradient(distance, STEP_S),
        "miss": miss,
        "time_to": time_to,
        "bearing": bearing,
        "abs_bearing": np.abs(bearing),
        "aspect": np.abs(_degrees(behind)),
        "reciprocal": np.abs(_degrees(-seen.their_v * seen.own_v.conj())),
        "own_speed": np.abs(seen.own_v),
        "their_speed": np.abs(seen.their_v),
        "along": behind.real,
        "beyond": behind.imag,
        "under_way": since_s - 4.0,
    }


def _constants(length_m: float, s: TemporalSettings) -> dict[str, float]:
    return {
        "in_sight": s.in_sight * length_m,
        "too_near": s.too_near * length_m,
        "clear": s.clear * length_m,
        "ahead": s.ahead_s,
        "nearly": s.nearly_deg,
        "holds": s.holds_deg,
        "minus_holds": -s.holds_deg,
        "slow_share": s.holds_share,
        "apparent": s.apparent_s,
        "large": s.large_deg,
        "large_share": s.large_share,
    }


def _meetings(
    tracks: Tracks,
    pair: tuple[int, int],
    pose: Float64,
    first: int,
    settings: TemporalSettings,
) -> Iterator[Finding]:
    hulls = tracks.bodies[pair[0]], tracks.bodies[pair[1]]
    seen = _seen(pose, hulls)
    signals = _lookout(seen, tracks.times[first : first + len(pose)])
    values = _constants(hulls[0].length_m, settings)
    inner = len(pose) - round(1.0 / STEP_S)
    risk = robustness(RISK, signals, values)[:inner] >= 0.0
    past = robustness(PAST, signals, values) >= 0.0
    roles = {name: robustness(formula, signals, values) >= 0.0 for name, formula in _ROLES.items()}
    begin = 0
    while begin < inner:
        ahead = np.flatnonzero(risk[begin:])
        if not len(ahead):
            return
        begin += int(ahead[0])
        known = begin + round(1.0 / STEP_S)
        gone = np.flatnonzero(past[known:])
        clear_s = round(2.0 / STEP_S)
        end = min(known + int(gone[0]) + clear_s if len(gone) else len(pose), len(pose))
        role = next((role for role, name in _ORDER if roles[name][known]), None)
        if role is not None and end - begin > 1:
            yield _verdict(tracks, pair, seen, signals, values, (first, begin, known, end), role)
        begin = max(end, begin + 1)


_ROLES = {
    "overtakes": OVERTAKES,
    "overtaken": OVERTAKEN,
    "head_on": HEAD_ON,
    "on_starboard": ON_STARBOARD,
    "on_port": ON_PORT,
}
_ORDER: tuple[tuple[Role, str], ...] = (
    ("overtaking", "overtakes"),
    ("stand_on", "overtaken"),
    ("head_on", "head_on"),
    ("give_way", "on_starboard"),
    ("stand_on", "on_port"),
)
"""Rule 13 overrides those that follow it; who is nearly astern and slower is nobody's business."""


def _verdict(
    tracks: Tracks,
    pair: tuple[int, int],
    seen: _Seen,
    signals: Signals,
    values: dict[str, float],
    samples: tuple[int, int, int, int],
    role: Role,
) -> Finding:
    first, begin, known, end = samples
    window = slice(begin, end)
    gap = hull_gap(seen, window)
    nearest = begin + int(gap.argmin())
    contact = _ended_in_contact(tracks, pair, first + nearest, float(gap.min()))
    here = _conduct(seen, signals, values, (begin, known, nearest, end), gap, contact)
    broken = [words for formula, words in _ASKED[role] if robustness(formula, here, values)[0] < 0]
    if role == "stand_on" and abs(signals["bearing"][known]) > 112.5:
        broken = [words for words in broken if words != TO_PORT]
    why = "it touched the other" if contact else ", ".join(broken)
    turned, at = _first_alteration(here)
    readable = None if role == "stand_on" else bool(robustness(READABLE, here, values)[0] >= 0)
    return Finding(
        ego=pair[0],
        other=pair[1],
        role=role,
        begin_s=_at(tracks, first + begin),
        nearest_s=_at(tracks, first + nearest),
        end_s=_at(tracks, first + end - 1),
        kept=not why,
        why=why,
        contact=contact,
        closest_m=round(float(gap.min()), 3),
        altered_deg=round(turned, 1),
        altered_before_s=None if at is None else round(STEP_S * (nearest - begin - at), 3),
        readable=readable,
    )


TO_PORT = "it turned to port for a vessel on its port side"
_ASKED: dict[Role, tuple[tuple[str, str], ...]] = {
    "overtaking": ((KEEPS_CLEAR, "it did not keep clear"),),
    "head_on": ((PASSES_PORT, "they did not pass port to port, or it turned to port"),),
    "give_way": ((NOT_AHEAD, "it crossed ahead"), (KEEPS_CLEAR, "it did not keep clear")),
    "stand_on": ((STANDS_ON, "it did not keep course and speed"), (NOT_TO_PORT, TO_PORT)),
}
"""What each role's rules ask, and what is said of who did not do it."""


def _at(tracks: Tracks, sample: int) -> float:
    return round(float(tracks.times[sample]), 3)


def _conduct(
    seen: _Seen,
    signals: Signals,
    values: dict[str, float],
    samples: tuple[int, int, int, int],
    gap: Float64,
    contact: bool,
) -> dict[str, Float64]:
    """Give what the judged vessel did from the beginning of a meeting on, as signals."""
    begin, known, nearest, end = samples
    window = slice(begin, end)
    count = end - begin
    before = seen.own_v[begin : known + 1].mean()
    way = np.abs(seen.own_v[window])
    turned = np.where(way >= 0.5, _degrees(seen.own_v[window] / before), 0.0)
    share = way / max(abs(before), 1e-3)
    between = seen.theirs[window] - seen.own[window]
    held_time, held_miss = _predicted(between, seen.their_v[window] - before, seen.hulls)
    number = np.arange(count)
    here = {name: signal[window] for name, signal in signals.items()}
    here |= {
        "gap": gap,
        "contact": np.full(count, float(contact)),
        "nearest": (number == nearest - begin).astype(float),
        "before": (number <= nearest - begin).astype(float),
        "turned": turned,
        "abs_turned": np.abs(turned),
        "slower": 1.0 - share,
        "faster": share - 1.0,
        "held_miss": held_miss,
        "held_time": held_time,
    }
    here["ample"] = (number <= nearest - begin - round(DEFAULT.ample_s / STEP_S)).astype(float)
    apparent = robustness(APPARENT, here, values) >= 0.0
    over = robustness(OVER, here, values) >= 0.0
    late = np.maximum.accumulate(apparent)
    here["late"] = late.astype(float)
    here["released"] = (late | over | (number >= nearest - begin)).astype(float)
    return here


def _first_alteration(here: Signals) -> tuple[float, int | None]:
    """Give the first alteration before the two are nearest [deg, starboard], and its sample."""
    counts = (here["abs_turned"] >= 10.0) | (here["slower"] >= 0.3)
    first = np.flatnonzero(counts & (here["before"] >= 1.0))
    if not len(first):
        return 0.0, None
    begin = int(first[0])
    stretch = here["turned"][begin : begin + round(5.0 / STEP_S)]
    most = stretch[np.abs(stretch).argmax()]
    return (float(most) if abs(most) >= 10.0 else 0.0), begin


def hull_gap(seen: _Seen, window: slice) -> Float64:
    """Give the distance [m] between two hulls at every sample, by points along their outlines."""
    own, other = seen.hulls
    if own.circle and other.circle:
        between = np.abs(seen.theirs[window] - seen.own[window])
        apart: Float64 = between - _size(own) - _size(other)
        return apart
    there = (seen.theirs[window] - seen.own[window])[:, None]
    outline = there + seen.their_bow[window, None] * _points(other)[None]
    if own.circle:
        near: Float64 = np.abs(outline).min(axis=1) - _size(own)
        return near
    mine = seen.own_bow[window, None] * _points(own)[None]
    both: Float64 = np.abs(outline[:, :, None] - mine[:, None, :]).min(axis=(1, 2))
    return both


def _points(hull: Body) -> Complex:
    """Give points every quarter of a metre, or sixtieth of its length, along a hull's outline."""
    if hull.circle:
        return np.asarray(_size(hull) * np.exp(2j * np.pi * np.arange(48) / 48))
    half = complex(hull.length_m, hull.beam_m) / 2
    corners = [half, half.conjugate(), -half, -half.conjugate(), half]
    step = max(0.25, hull.length_m / 60)
    sides = [
        np.linspace(a, b, max(int(abs(b - a) / step), 1), endpoint=False)
        for a, b in pairwise(corners)
    ]
    return np.concatenate(sides)


def _ended_in_contact(tracks: Tracks, pair: tuple[int, int], sample: int, gap: float) -> bool:
    """Tell whether the two touched: by how the voyage ended, if that is known."""
    hull = tracks.bodies[pair[0]]
    if hull.outcome is None:
        return gap <= 0.0
    if hull.outcome != "collision" or hull.ended_s is None:
        return False
    return abs(float(tracks.times[sample]) - hull.ended_s) <= 1.0 and gap <= 1.5
