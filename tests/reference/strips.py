"""A slow, plain reference of the strips: what a row of beams sees of an object without a break."""

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64


def strips(
    ranges: Float64, objects: NDArray[np.int32], p_L: Float64, wraps: bool, gap: float, far: float
) -> Float64:
    """Give rows of object, x, y, length, echoes, sorted.

    Parameters
    ----------
    ranges : (M, W) float64
        The range image [m]; 0 where there is no echo.
    objects : (M, W) int32
        Each cell's object; -1 where there is none.
    p_L : (M, W, 2) float64
        Where each cell's echo is [m].
    wraps : bool
        True if the last column is beside the first.
    gap, far : float
        The rules [m].
    """
    found = []
    for row in range(len(ranges)):
        for run in _runs(np.flatnonzero(ranges[row]), objects[row], p_L[row], wraps, gap):
            ends = [run[0], run[-1]]
            free = not any(
                _hidden(row, end, step, ranges, objects, wraps, gap)
                for end, step in zip(ends, (-1, 1), strict=True)
            )
            owner = objects[row, run[0]]
            if free and len(run) > 1 and owner >= 0 and ranges[row, ends].max() <= far:
                length = np.linalg.norm(p_L[row, ends[1]] - p_L[row, ends[0]])
                found.append([owner, *p_L[row, run].mean(axis=0), length, len(run)])
    table = np.array(found).reshape(-1, 5)
    return table[np.lexsort(table[:, [3, 2, 1, 0]].T)]


def _runs(columns, objects, p_L, wraps, gap):
    """Cut a row's occupied columns wherever object or place changes."""

    def one(a, b):
        return objects[a] == objects[b] and np.linalg.norm(p_L[a] - p_L[b]) < gap

    runs = []
    for column in columns.tolist():
        if runs and one(runs[-1][-1], column):
            runs[-1].append(column)
        else:
            runs.append([column])
    if wraps and len(runs) > 1 and one(runs[-1][-1], runs[0][0]):
        runs = [*runs[1:-1], runs[-1] + runs[0]]
    return runs


def _hidden(row, column, step, ranges, objects, wraps, gap):
    """Tell whether an end is at the image's edge, or beside an echo of a nearer object."""
    width = ranges.shape[1]
    for apart in (1, 2):
        beside = column + step * apart
        if not wraps and not 0 <= beside < width:
            return apart == 1  # the image ends here, the object may not
        beside %= width
        if ranges[row, beside] > 0:
            other = objects[row, beside] != objects[row, column]
            return bool(other and ranges[row, beside] < ranges[row, column] + gap)
    return False
