"""A plain tracker to compare with: constant velocity, nearest assignment, counts for its life.

It is given the same records of LiDAR and radar, the same noise and range, and no more: no delays,
no existence, no clutter. A track is reported after 3 detections and dropped 4 s after its last one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from twinscrew.hil_sim.tracks.autoferry import (
    POSITIONS,
    Frame,
    Record,
    RecordingSettings,
    Reported,
    look_of,
    within_range,
)
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.kalman import STATES, FilterBank, motion_noise, transition

PSD, FIRST_MPS, GATE_SIGMA, HITS, COAST_S = 0.3, 2.5, 4.0, 3, 4.0


@dataclass(slots=True, eq=False)
class _Plain:
    x: Float64
    P: Float64
    seen_s: float
    hits: int = 1
    id: int = -1


def track_nearest(
    records: Sequence[Record], sensors: Sequence[str], settings: RecordingSettings
) -> Iterator[Frame]:
    """Give what the plain tracker reports after each record of LiDAR and radar."""
    bank, tracks, last_s, names = FilterBank(), list[_Plain](), None, 0
    for record in records:
        if record.sensor not in sensors or record.sensor not in POSITIONS:
            continue
        dt = 0.0 if last_s is None else max(record.time_s - last_s, 0.0)
        last_s = record.time_s
        look = look_of(within_range(record, settings), settings)
        H = look.H.copy()
        H[:, :, 4:] = 0.0
        if tracks:
            x, P = np.array([t.x for t in tracks]), np.array([t.P for t in tracks])
            Q = np.broadcast_to(motion_noise(dt, PSD), P.shape)
            x, P = bank.predict(x, P, transition(dt, 1.0), Q)
            for k, plain in enumerate(tracks):
                plain.x, plain.P = x[k], P[k]
        pairs = _assigned(tracks, look.z, look.R)
        for k, m in pairs:
            plain = tracks[k]
            x, P = bank.update(
                plain.x[None], plain.P[None], look.z[m][None], H[m][None], look.R[m][None]
            )
            plain.x, plain.P, plain.seen_s = x[0], P[0], record.time_s
            plain.hits += 1
            if plain.id < 0 and plain.hits >= HITS:
                plain.id, names = names, names + 1
        used = {m for _, m in pairs}
        for m in (m for m in range(len(look.z)) if m not in used):
            P = np.zeros((STATES, STATES))
            P[:2, :2], P[2, 2], P[3, 3] = look.R[m], FIRST_MPS**2, FIRST_MPS**2
            tracks.append(_Plain(np.concatenate([look.z[m], np.zeros(4)]), P, record.time_s))
        tracks = [t for t in tracks if record.time_s - t.seen_s <= COAST_S]
        reported = [Reported(t.id, t.x, t.P, 1.0) for t in tracks if t.id >= 0]
        yield Frame(record.time_s, record.sensor, reported)


def _assigned(tracks: list[_Plain], z: Float64, R: Float64) -> list[tuple[int, int]]:
    if not tracks or not len(z):
        return []
    cost = np.full((len(tracks), len(z)), 1e6)
    for k, plain in enumerate(tracks):
        for m in range(len(z)):
            y, S = z[m] - plain.x[:2], plain.P[:2, :2] + R[m]
            distance2 = float(y @ np.linalg.solve(S, y))
            if distance2 <= GATE_SIGMA**2:
                cost[k, m] = distance2 + float(np.log(np.linalg.det(S)))
    rows, columns = linear_sum_assignment(cost)
    return [
        (k, m) for k, m in zip(rows.tolist(), columns.tolist(), strict=True) if cost[k, m] < 1e6
    ]
