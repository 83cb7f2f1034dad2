"""A range image from the points themselves, for scans that no description fits.

Other people's clouds were corrected for motion or calibration, thinned, or come from a sensor that
nobody described. Their beams are found where their elevations gather; if those are smeared, rows
of equal height take their place.
"""

from __future__ import annotations

import math

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32, Float64
from twinscrew.runtime.perception.sensor import Beams, Columns, Sensor

BEAMS = (4, 256)
"""[-] Fewest and most rows of an image."""
STEP_DEG = (0.05, 1.0)
"""[deg] Finest and coarsest columns of an image."""
BIN_DEG = 0.02
"""[deg] Of the histogram in which elevations gather."""
SMOOTH_DEG = 0.06
"""[deg] Standard deviation of what smooths it."""
PEAK = 0.5
"""[-] A beam's peak rises over the valley beside it by this share of its height, at least."""
SLICE_DEG = 0.1
"""[deg] Echoes within so little elevation mostly come from one beam."""
TOO_FEW = 100
"""[-] Points that show no pattern."""


def fitted(points_S: Float32, ring: NDArray[np.uint16] | None, like: Sensor) -> list[Sensor]:
    """Give sensors that might have taken these points, most trustworthy first.

    Parameters
    ----------
    points_S : (N, 3) float32
        Points [m], frame S (FRD); those without an echo are left out.
    ring : (N,) uint16
        The beam of each point, where the file tells it.
    like
        Noise, range and all else are this sensor's; its scan is of one moment.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        seen = np.isfinite(points_S).all(axis=1) & (np.abs(points_S).max(axis=1, initial=0) > 0)
    x, y, z = points_S[seen].T.astype(np.float64)
    if len(x) < TOO_FEW:
        return []
    elevation, azimuth = np.arctan2(-z, np.hypot(x, y)), np.arctan2(y, x)
    step = _azimuth_step(elevation, azimuth)
    beams = [_gathered(elevation), _even(elevation, azimuth, step)]
    if ring is not None:
        beams.insert(0, _ring_medians(elevation, ring[seen]))
    columns = Columns(
        count=max(2, round(2 * math.pi / step)),
        first_rad=math.pi,
        span_rad=-2 * math.pi,
        endpoint=False,
    )
    return [
        structs.replace(
            like,
            name=f"fitted to {len(degrees)} beams",
            beams=Beams(elevations_deg=tuple(degrees.tolist())),
            columns=columns,
            scan_duration_s=0.0,
        )
        for degrees in map(_apart, beams)
        if BEAMS[0] <= len(degrees) <= BEAMS[1]
    ]


def _azimuth_step(elevation: Float64, azimuth: Float64) -> float:
    """Take the usual gap of azimuths within thin slices of elevation."""
    thin = np.floor(elevation / math.radians(SLICE_DEG))
    order = np.lexsort((azimuth, thin))
    gaps = np.diff(azimuth[order])[np.diff(thin[order]) == 0]
    least, most = np.radians(STEP_DEG)
    gaps = gaps[(gaps > 0.5 * least) & (gaps < 2 * most)]
    usual = float(np.percentile(gaps, 40)) if len(gaps) else most
    return float(np.clip(usual, least, most))


def _ring_medians(elevation: Float64, ring: NDArray[np.uint16]) -> Float64:
    """[deg] Give the middle elevation of each ring."""
    order = np.lexsort((elevation, ring))
    _, first, count = np.unique(ring[order], return_index=True, return_counts=True)
    middle: Float64 = np.degrees(np.sort(elevation[order][first + count // 2]))
    return middle


def _gathered(elevation: Float64) -> Float64:
    """[deg] Give where elevations gather: the peaks of a smoothed histogram."""
    from scipy.ndimage import gaussian_filter1d
    from scipy.signal import find_peaks

    degrees = np.degrees(elevation)
    low = degrees.min() - 1.0
    counts = np.bincount(((degrees - low) / BIN_DEG).astype(np.int64)).astype(np.float64)
    smooth = gaussian_filter1d(np.append(counts, np.zeros(50)), SMOOTH_DEG / BIN_DEG)
    peaks, found = find_peaks(smooth, prominence=1e-3 * smooth.max())
    peaks = peaks[found["prominences"] > PEAK * smooth[peaks]]
    return np.asarray(low + (peaks + 0.5) * BIN_DEG, dtype=np.float64)


def _even(elevation: Float64, azimuth: Float64, step: float) -> Float64:
    """[deg] Give rows as far apart as points within one column usually are."""
    column = np.floor(azimuth / step)
    order = np.lexsort((elevation, column))
    gaps = np.degrees(np.diff(elevation[order])[np.diff(column[order]) == 0])
    gaps = gaps[gaps > 2 * BIN_DEG]
    if len(gaps) == 0:
        return np.empty(0)
    lowest, highest = np.percentile(np.degrees(elevation), [0.1, 99.9])
    rows = int(np.clip((highest - lowest) / np.median(gaps), *BEAMS)) + 1
    return np.linspace(lowest, highest, min(rows, BEAMS[1]))


def _apart(degrees: Float64) -> Float64:
    """Drop beams that coincide with the one below, or leave what a description may say."""
    degrees = degrees[np.abs(degrees) < 89.0]
    return degrees[np.diff(degrees, prepend=-np.inf) > BIN_DEG]
