"""Pieces of one object, put together: what lies within a track's circle is that track's.

In some scans a hull falls into pieces (its deck seen over one float, say). Each alone has another
centroid, and following the nearest of them would look like motion. Two bodies that float cannot
have their centres within one circle, so pieces that do belong together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime._native import crowded
from twinscrew.runtime.messages.types import Float64, Objects, Strips


def join_fragments(
    objects: Objects, stands: Sequence[bool | None], p_L: Float64, radius: Float64
) -> tuple[Objects, Sequence[bool | None]]:
    """Replace objects within the circle of one track by one object.

    Parameters
    ----------
    objects
        As perception found them.
    stands : (M,)
        Of each, see `standing.Standing.pieces`: pieces of what stands remain apart.
    p_L : (K, 2) float64
        Where the tracks are expected [m], levelled frame L.
    radius : (K,) float64
        Radii of their circles [m].

    Returns
    -------
    Objects
        The joined ones first: the mean of the points, the circle around that mean that holds the
        pieces' circles, the sum of the points. The others follow as they were.
    stands
        Of those: of what was joined nothing is known.
    """
    if not crowded(objects.p_L, p_L, radius):
        return objects, stands
    offset = objects.p_L[None, :, :] - p_L[:, None, :]
    within = np.hypot(offset[..., 0], offset[..., 1]) <= radius[:, None]
    alone = np.array([stand is True for stand in stands])
    groups, free = [], ~alone
    for members in within:
        pieces = np.flatnonzero(members & free)
        if len(pieces) > 1:
            groups.append(pieces)
            free[pieces] = False
    rows = [_joined(objects, pieces) for pieces in groups]
    kept = np.flatnonzero(free | alone)
    rows += [(*objects.p_L[i], objects.radius[i], objects.points[i]) for i in kept]
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    joined = Objects(
        stamp_ns=objects.stamp_ns,
        p_L=table[:, :2],
        radius=table[:, 2],
        points=table[:, 3].astype(np.int64),
        strips=_regrouped(objects.strips, [*groups, *kept.reshape(-1, 1)]),
    )
    return joined, [*[None] * len(groups), *(stands[i] for i in kept.tolist())]


def _regrouped(strips: Strips | None, groups: Sequence[NDArray[np.intp]]) -> Strips | None:
    """Give each group of objects the strips of its members."""
    if strips is None:
        return None
    begin, end = strips.begin[:-1], strips.begin[1:]
    rows = [np.arange(begin[i], end[i]) for members in groups for i in members]
    counts = [int((end[members] - begin[members]).sum()) for members in groups]
    return Strips(
        begin=np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]),
        rows_L=strips.rows_L[np.concatenate(rows)],
    )


def _joined(objects: Objects, pieces: NDArray[np.intp]) -> tuple[float, float, float, float]:
    """Give x, y, radius and points of pieces put together."""
    p, points = objects.p_L[pieces], objects.points[pieces]
    centre = points @ p / points.sum()
    away = np.hypot(p[:, 0] - centre[0], p[:, 1] - centre[1])
    reach = float((away + objects.radius[pieces]).max())
    return float(centre[0]), float(centre[1]), reach, float(points.sum())
