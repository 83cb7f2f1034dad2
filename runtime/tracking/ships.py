"""Long vessels under way: one track with an outline, in the place of one for each piece.

Perception cuts what is longer than a circle into pieces, and the visible part of a hull changes
with the aspect: tracks of the pieces slide along the hull. Where `LongObjects` says that the long
object moves, its echoes are fitted by a rectangle instead. The side that faces the sensor is seen,
the far one is not: the beam is the largest that was seen, the centre lies half a beam behind the
near side. If an end is hidden, the other one tells where the centre is. What comes into sight only
now makes the outline larger, and is no motion. From then on the track keeps its outline, and takes
in all echoes within it, until the long object is found to be at rest.

Source of the fit: Zhang, Xu, Dong, Dolan (2017), Efficient L-shape fitting for vehicle detection
using laser scanners, IEEE Intelligent Vehicles Symposium (their criterion "closeness").
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.geometry import wrap
from twinscrew.runtime.messages.types import Float64, Objects, Strips
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.tracking.lidar import Viewpoint
from twinscrew.runtime.tracking.track import Hull, Track


class ShipSettings(Settings, frozen=True, kw_only=True):
    """When pieces are followed as one long vessel."""

    longest_m: NonNegative = 80.0
    """[m] What is longer is followed in pieces; 0: everything is."""
    least_mps: Positive = 0.7
    """[m/s] So fast must the pieces be, by the median, to become one vessel."""
    margin_m: Positive = 1.5
    """[m] Echoes so far outside of its outline are still the vessel's."""
    straight_m: Positive = 0.5
    """[m] Echoes lie this near its near sides, in the mean."""
    beam_share: Positive = 0.25
    """[-] Its beam as a share of its length, at least: of most the far side is never seen."""
    sigma_m: Positive = 0.25
    """[m] White noise of its centre where both ends are seen,"""
    hidden_sigma_m: Positive = 1.0
    """[m] and along it where one is not."""
    acceleration_psd: Positive = 0.1
    """[m2/s3] Density of its white acceleration: long vessels are slow to change their way."""
    rest_s: Positive = 3.0
    """[s] At rest for so long it is followed in pieces again, as all that is long and stands."""


ANGLES = np.radians(np.arange(0.0, 90.0, 2.0))
"""[rad] Headings that are tried for a rectangle: those of its other sides follow."""
ASKEW_RAD = 0.5
"""[rad] No vessel's course differs from its heading by more."""
WIDEST_M = 15.0
"""[m] Wider than this is no vessel of the greatest length."""
LEAST_POINTS = 4
"""[-] Fewer echoes of the outline tell nothing."""
LEAST_FIT, LEAST_FIT_M = 6, 3.0
"""[-], [m] So many echoes, over so long a side, tell how it points;"""
TURN_GAIN = 0.1
"""[-] and a scan turns the outline by this share of what it tells."""
MOST_GROWTH_M = 1.0
"""[m] By so much an outline grows in one scan at most."""
END_M = 2.0
"""[m] What comes this near the end of sight may go on beyond."""


@dataclass(frozen=True, slots=True)
class SeenShip:
    """What a scan shows of a long vessel."""

    track: int
    """Its row among the tracks."""
    p_N: Float64
    """[m] [N] (2,) Its centre."""
    R: Float64
    """[m2] [N] (2, 2) White noise of that."""
    hull: Hull
    """Its outline."""
    at_rest: bool
    """Whether all long objects within it are at rest."""
    members: NDArray[np.bool_]
    """(K,) Which of the scan's objects are parts of it."""
    shift_N: Float64
    """[m] [N] (2,) By so much its centre is elsewhere because more of it is known."""
    v_N: Float64 | None = None
    """[m/s] [N] (2,) Its velocity by its pieces, if it has just become one vessel."""


def find_ships(
    tracks: Sequence[Track],
    x: Float64,
    objects: Objects,
    at_rest: Sequence[bool | None],
    own: Viewpoint,
    reach_m: float,
    settings: ShipSettings,
) -> list[SeenShip]:
    """Find the long vessels of a scan: those known, and those that pieces turn out to be.

    Parameters
    ----------
    tracks, x : (N,), (N, 6) float64
        Tracks, and their states at the scan's stamp.
    objects, at_rest
        As perception found them, and as `LongObjects.at_rest` says.
    own
        From where the scan was taken.
    reach_m
        How far echoes are used [m].
    """
    outline = objects.outline
    if outline is None or not settings.longest_m or not own.is_known:
        return []
    known = [k for k, track in enumerate(tracks) if track.hull is not None]
    said_of = dict(zip(outline.cut_from.tolist(), at_rest, strict=True))
    moving = {number for number, rests in said_of.items() if number >= 0 and rests is False}
    if not known and not moving:
        return []
    echo = np.isfinite(outline.height_m)
    points, number = own.in_N(outline.boundary_L[echo]), outline.seen[echo]
    eye = own.in_N(outline.sensor_L[None, :2])[0]
    objects_N = own.in_N(objects.p_L)
    free, taken = np.ones(len(points), np.bool_), np.zeros(len(objects_N), np.bool_)
    found: list[SeenShip] = []

    def add(row: int, mine: NDArray[np.bool_], hull: Hull, v_N: Float64 | None) -> None:
        p_N, R, now, shift_N = _measured(points[mine], eye, hull, x[row, :2], settings)
        if v_N is not None:
            shift_N = np.zeros(2)
        members = ~taken & _within(objects_N, p_N, now, settings.margin_m)
        free[mine] = False
        taken[members] = True
        said = [at_rest[k] for k in np.flatnonzero(members).tolist()]
        rests = True in said and False not in said
        found.append(SeenShip(row, p_N, R, now, rests, members, shift_N, v_N))

    for row in known:
        hull = tracks[row].hull
        assert hull is not None  # noqa: S101  (`known`)
        mine = free & _within(points, x[row, :2], hull, settings.margin_m)
        if np.count_nonzero(mine) >= LEAST_POINTS:
            more = free & np.isin(number, [n for n in set(number[mine].tolist()) if n in moving])
            if _fits(points[mine | more], hull, settings):
                mine |= more
            add(row, mine, _turned(hull, points[mine]), None)
    for long in sorted(moving):
        mine = free & (number == long)
        if np.count_nonzero(mine) < max(LEAST_POINTS, 0.7 * np.count_nonzero(number == long)):
            continue
        ends = np.hypot(*(points[mine] - eye).T)
        if ends.max() > reach_m - END_M:
            continue
        pieces = _pieces(tracks, x, points[mine])
        if not pieces:
            continue
        v_N = np.median(x[pieces, 2:4], axis=0)
        new = _first_hull(points[mine], eye, v_N, settings)
        if new is not None and float(np.hypot(*v_N)) >= settings.least_mps:
            add(min(pieces, key=lambda k: tracks[k].id), mine, new, v_N)
    return found


def without(
    objects: Objects, at_rest: Sequence[bool | None], members: NDArray[np.bool_]
) -> tuple[Objects, Sequence[bool | None]]:
    """Give the objects that are no parts of long vessels, and what is said of them."""
    rows = np.flatnonzero(~members)
    strips = objects.strips
    if strips is not None:
        begin, end = strips.begin[rows], strips.begin[rows + 1]
        kept = [np.arange(b, e) for b, e in zip(begin.tolist(), end.tolist(), strict=True)]
        strips = Strips(
            begin=np.concatenate([[0], np.cumsum(end - begin)]).astype(np.int64),
            rows_L=strips.rows_L[np.concatenate(kept) if kept else np.empty(0, np.intp)],
        )
    outline = objects.outline
    rest = replace(
        objects,
        p_L=objects.p_L[rows],
        radius=objects.radius[rows],
        points=objects.points[rows],
        strips=strips,
        outline=None if outline is None else replace(outline, cut_from=outline.cut_from[rows]),
    )
    return rest, [at_rest[k] for k in rows.tolist()]


def in_outline(p_N: Float64, track: Track, margin_m: float) -> bool:
    """Tell whether a place (2,) [m] lies within the outline of a long vessel's track."""
    if track.hull is None:
        return False
    return bool(_within(p_N[None], track.x[:2], track.hull, margin_m)[0])


def _axes(heading: float) -> Float64:
    """Give the directions ahead and to starboard, (2, 2), by rows."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array([[c, s], [-s, c]])


def _within(points: Float64, centre: Float64, hull: Hull, margin_m: float) -> NDArray[np.bool_]:
    away = np.abs((points - centre) @ _axes(hull.heading).T)
    most = np.array([hull.half_length, hull.half_beam]) + margin_m
    inside: NDArray[np.bool_] = np.all(away <= most, axis=1)
    return inside


def _fits(points: Float64, hull: Hull, settings: ShipSettings) -> bool:
    """Tell whether echoes can be those of one vessel with this heading, now that more is seen."""
    length, beam = np.ptp(points @ _axes(hull.heading).T, axis=0).tolist()
    return bool(length <= settings.longest_m and beam <= hull.half_beam * 2 + settings.margin_m)


def _pieces(tracks: Sequence[Track], x: Float64, points: Float64) -> list[int]:
    """Give the rows of the tracks that are pieces of what has these echoes."""
    rows = [
        k
        for k, t in enumerate(tracks)
        if t.confirmed and t.scans and t.hull is None and t.named is None and not t.at_rest
    ]
    if not rows:
        return []
    apart = np.linalg.norm(x[rows, None, :2] - points, axis=2).min(axis=1)
    return [k for k, near in zip(rows, apart.tolist(), strict=True) if near <= tracks[k].radius]


def _fitted_heading(points: Float64) -> float:
    """[rad] Give the heading, modulo a quarter turn, of the rectangle that fits best."""
    axes = np.stack(
        [np.cos(ANGLES), np.sin(ANGLES), -np.sin(ANGLES), np.cos(ANGLES)], axis=1
    ).reshape(-1, 2, 2)
    along = axes @ points.T  # (A, 2, P)
    to_edge = np.minimum(
        along - along.min(axis=2, keepdims=True), along.max(axis=2, keepdims=True) - along
    )
    closeness = (1.0 / np.maximum(to_edge.min(axis=1), 0.1)).sum(axis=1)
    return float(ANGLES[int(closeness.argmax())])


def _nearest_turn(fitted: float, heading: float) -> float:
    """[rad] Give that of the four headings of a rectangle's sides that is nearest to another."""
    quarter = 0.5 * math.pi
    return heading + (wrap(fitted - heading) + 0.5 * quarter) % quarter - 0.5 * quarter


def _first_hull(points: Float64, eye: Float64, v_N: Float64, settings: ShipSettings) -> Hull | None:
    """Give the outline of what has these echoes; None if it is no vessel's."""
    course = math.atan2(v_N[1], v_N[0])
    heading = _nearest_turn(_fitted_heading(points), course)
    if abs(float(wrap(heading - course))) > ASKEW_RAD:
        heading = course  # end-on little of its side is seen
    along = points @ _axes(heading).T
    low, high = along.min(axis=0), along.max(axis=0)
    length, beam = float(high[0] - low[0]), float(high[1] - low[1])
    sight = _axes(heading) @ eye
    if max(length, beam) > settings.longest_m or beam > WIDEST_M:
        return None
    length = max(length, beam)
    if np.all(sight >= low - 1.0) and np.all(sight <= high + 1.0):
        return None  # the boat is within it: a basin
    near = np.full(len(points), np.inf)
    for axis in range(2):
        if sight[axis] < low[axis]:
            near = np.minimum(near, along[:, axis] - low[axis])
        elif sight[axis] > high[axis]:
            near = np.minimum(near, high[axis] - along[:, axis])
    if float(near.mean()) > settings.straight_m:
        return None  # a corner of a quay, seen from within
    return Hull(
        0.5 * length, 0.5 * max(beam, settings.beam_share * length), float(wrap(heading)), 0.0
    )


def _turned(hull: Hull, points: Float64) -> Hull:
    """Turn an outline as its echoes say.

    Its course does not say: where only an end is seen, a wrong heading moves the centre sideways,
    and that would be taken for its course.
    """
    if len(points) < LEAST_FIT or float(np.hypot(*np.ptp(points, axis=0))) < LEAST_FIT_M:
        return hull
    off = float(wrap(_nearest_turn(_fitted_heading(points), hull.heading) - hull.heading))
    if abs(off) > ASKEW_RAD:
        return hull
    return replace(hull, heading=float(wrap(hull.heading + TURN_GAIN * off)))


def _measured(
    points: Float64,
    eye: Float64,
    hull: Hull,
    expected: Float64,
    settings: ShipSettings,
) -> tuple[Float64, Float64, Hull, Float64]:
    """Give centre, its noise, the outline as it is known now, and how that shifts the centre."""
    axes = _axes(hull.heading)
    along, sight, middle = points @ axes.T, axes @ eye, axes @ expected
    low, high = along.min(axis=0), along.max(axis=0)
    seen = (high - low).tolist()
    length, beam = 2.0 * hull.half_length, 2.0 * hull.half_beam
    whole = seen[0] >= 0.9 * length
    if seen[0] > length:
        grown = min(seen[0] - length, MOST_GROWTH_M)
    else:
        grown = 0.02 * (seen[0] - length) if whole else 0.0
    length += grown
    wide = max(beam, min(seen[1], 0.5 * length), settings.beam_share * length)
    # It is the far end that comes into sight; abeam, that which lies beyond what was expected.
    away = np.sign(middle - sight)
    if low[0] <= sight[0] <= high[0]:
        away[0] = np.sign(low[0] + high[0] - 2.0 * middle[0])
    shift = 0.5 * away * np.array([grown, wide - beam])
    beam, middle = wide, middle + shift
    centre = 0.5 * (low + high)
    if not whole:
        ends = (low[0] + 0.5 * length, high[0] - 0.5 * length)
        centre[0] = min(ends, key=lambda end: abs(end - middle[0]))
    if sight[1] < low[1]:
        centre[1] = low[1] + 0.5 * beam
    elif sight[1] > high[1]:
        centre[1] = high[1] - 0.5 * beam
    sigma = np.array([settings.sigma_m if whole else settings.hidden_sigma_m, settings.sigma_m])
    R = axes.T @ np.diag(sigma**2) @ axes
    now = replace(hull, half_length=0.5 * length, half_beam=0.5 * beam)
    return centre @ axes, R, now, shift @ axes
