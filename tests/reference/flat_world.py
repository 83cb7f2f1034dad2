"""A flat world of straight sides, and what exact rays from a boat in it find.

It stands for perception where only the outline matters: one row of rays, no noise, nothing missed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import Float64, Objects, Outline
from twinscrew.runtime.tracking.lidar import Viewpoint
from twinscrew.runtime.tracking.lidar_motion import LongObjects, LongObjectSettings

NOTHING = -1
LONGEST_M, PIECE_M = 6.5, 4.0
"""[m] Longer things are cut, into pieces no longer than this."""


@dataclass(frozen=True)
class Body:
    """Sides from corner to corner, that go where they go without turning."""

    corners_N: Float64
    """[m] (P, 2) At time 0."""
    velocity_N: Float64
    """[m/s] (2,)"""
    start_s: float = 0.0
    """[s] Before this it lies still,"""
    stop_s: float = math.inf
    """[s] and after this again."""

    def corners(self, t: float) -> Float64:
        """Give where its corners are, (P, 2) [m]."""
        under_way_s = max(min(t, self.stop_s) - self.start_s, 0.0)
        return self.corners_N + under_way_s * self.velocity_N


def wall(*corners_N: tuple[float, float]) -> Body:
    """Give a wall."""
    return Body(np.array(corners_N, dtype=np.float64), np.zeros(2))


def ship(
    north: float,
    east: float,
    heading: float,
    speed: float,
    size: tuple[float, float] = (14.0, 3.0),
    *,
    start_s: float = 0.0,
    stop_s: float = math.inf,
) -> Body:
    """Give a box, length and beam [m], around a place, that goes ahead."""
    box = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1], [1, 1]]) / 2.0 * np.array(size)
    R = rotation_2d(heading)
    return Body(box @ R.T + np.array([north, east]), speed * R[:, 0], start_s, stop_s)


@dataclass(frozen=True)
class Eye:
    """What looks around: rays in the middle of sectors, clockwise."""

    sectors: int = 720
    span: float = 2 * math.pi
    """[rad] Around the bow."""
    reach_m: float = 20.0
    sensor_L: tuple[float, float] = (0.4, 0.0)

    def azimuths(self) -> Float64:
        """Give the rays' directions from the bow, (A,) [rad]."""
        step = self.span / self.sectors
        middles: Float64 = step * (np.arange(self.sectors, dtype=np.float64) + 0.5) - self.span / 2
        return middles

    @property
    def is_closed(self) -> bool:
        """True if there is no blind sector."""
        return self.span > 2 * math.pi - 1e-9


Place = tuple[float, float, float]
"""North, east [m], heading [rad]."""


def stand(place: Place) -> Viewpoint:
    """Give a place as the tracker has it."""
    return Viewpoint(np.array(place[:2]), rotation_2d(place[2]))


def look(
    bodies: Sequence[Body], t: float, place: Place, eye: Eye
) -> tuple[Objects, NDArray[np.int64]]:
    """Give what is seen from a place, and (K,) whose each object is."""
    own, azimuth = stand(place), eye.azimuths()
    rays_B = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    sensor_L = np.array(eye.sensor_L)
    reach, body = _cast(bodies, t, own.p_N + own.R_NL @ sensor_L, rays_B @ own.R_NL.T, eye.reach_m)
    boundary_L = sensor_L + reach[:, None] * rays_B
    table, owner, cut_from, seen = [], [], [], np.full(eye.sectors, NOTHING)
    for number, run in enumerate(_runs(body, eye.is_closed)):
        pieces = _cut(boundary_L[run])
        if len(pieces) > 1:
            seen[run] = number
        for piece in pieces:
            echoes = boundary_L[run[piece]]
            centre = echoes.mean(axis=0)
            radius = np.linalg.norm(echoes - centre, axis=1).max()
            table.append([*centre, radius, 20 * len(piece)])
            cut_from.append(number if len(pieces) > 1 else NOTHING)
            owner.append(body[run[0]])
    rows = np.array(table, dtype=np.float64).reshape(-1, 4)
    cut = np.array(cut_from, dtype=np.int64)
    outline = Outline(
        boundary_L=boundary_L,
        height_m=np.where(body == NOTHING, np.nan, 0.0),
        seen=seen,
        cut_from=cut,
        sector_rad=eye.span / eye.sectors,
        is_closed=eye.is_closed,
        sensor_L=np.array([*eye.sensor_L, 0.0]),
        down_L=np.array([0.0, 0.0, 1.0]),
        elevation_rad=np.empty(0),  # nothing is overlooked
        least_m=-math.inf,
    )
    objects = Objects(
        stamp_ns=round(t * 1e9),
        p_L=rows[:, :2],
        radius=rows[:, 2],
        points=rows[:, 3].astype(np.int64),
        outline=outline,
    )
    return objects, np.array(owner, dtype=np.int64)


def watch(
    bodies: Sequence[Body],
    path: Callable[[float], Place],
    times_s: Iterable[float],
    eye: Eye = Eye(),
    told: Callable[[Place], Viewpoint] = stand,
) -> list[list[set[bool | None]]]:
    """Give for each time and body what `LongObjects` says of its pieces; nothing if it has none.

    `told` gives the place that the odometry tells.
    """
    standing = LongObjects(LongObjectSettings())
    answers = []
    for t in times_s:
        objects, owner = look(bodies, t, path(t), eye)
        verdicts = standing.at_rest(objects, told(path(t)))
        assert objects.outline is not None
        rows = list(zip(verdicts, owner, objects.outline.cut_from, strict=True))
        assert all(verdict is None for verdict, _, number in rows if number == NOTHING)
        answers.append(
            [{v for v, whose, n in rows if whose == b and n >= 0} for b in range(len(bodies))]
        )
    return answers


def scans(seconds: float, first_s: float = 0.0) -> list[float]:
    """Give the times of ten scans a second."""
    return [first_s + 0.1 * k for k in range(round(10 * seconds))]


def _cast(
    bodies: Sequence[Body], t: float, p_N: Float64, rays_N: Float64, reach_m: float
) -> tuple[Float64, NDArray[np.int64]]:
    """Give how far each ray goes, (A,) [m], and what body it meets, or NOTHING."""
    best, body = np.full(len(rays_N), reach_m), np.full(len(rays_N), NOTHING)
    for number, one in enumerate(bodies):
        corners = one.corners(t)
        side, away = np.diff(corners, axis=0), corners[:-1] - p_N
        # p + r d = a + s side: crossing both with the other's direction leaves one unknown.
        across = rays_N[:, None, 0] * side[:, 1] - rays_N[:, None, 1] * side[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            r = (away[:, 0] * side[:, 1] - away[:, 1] * side[:, 0]) / across
            s = (away[:, 0] * rays_N[:, None, 1] - away[:, 1] * rays_N[:, None, 0]) / across
        met = np.where((r > 0.0) & (s >= 0.0) & (s <= 1.0), r, np.inf).min(axis=1)
        nearer = met < best
        best[nearer], body[nearer] = met[nearer], number
    return best, body


def _runs(body: NDArray[np.int64], is_closed: bool) -> Iterator[NDArray[np.intp]]:
    """Give the sectors of each row of rays, side by side, that meet one body."""
    cuts = np.flatnonzero(np.diff(body)) + 1
    runs = np.split(np.arange(len(body)), cuts)
    if is_closed and len(runs) > 1 and body[0] == body[-1]:
        runs = [np.concatenate([runs[-1], runs[0]]), *runs[1:-1]]
    return (run for run in runs if body[run[0]] != NOTHING)


def _cut(echoes: Float64) -> list[NDArray[np.intp]]:
    """Give the rows of the pieces, cut across the longest extent if that is too long."""
    centred = echoes - echoes.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
    along -= along.min()
    length = float(along.max())
    if length <= LONGEST_M:
        return [np.arange(len(echoes))]
    count = math.ceil(length / PIECE_M)
    piece = np.minimum((along * count / length).astype(int), count - 1)
    return [rows for k in range(count) if len(rows := np.flatnonzero(piece == k))]
