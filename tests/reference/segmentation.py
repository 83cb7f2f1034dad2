"""A slow, plain reference of the kernel: numpy, trigonometry and scipy's connected components."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from twinscrew.runtime.perception.sensor import Sensor


def cells(points_S: NDArray[np.float32], sensor: Sensor) -> tuple[NDArray[np.int64], ...]:
    """Give each point's row, column (-1 where it fits no beam) and range."""
    p = points_S.astype(np.float64)
    e = sensor.elevations
    edges = np.concatenate(
        [[1.5 * e[0] - 0.5 * e[1]], (e[1:] + e[:-1]) / 2, [1.5 * e[-1] - 0.5 * e[-2]]]
    )
    elevation = np.arctan2(-p[:, 2], np.hypot(p[:, 0], p[:, 1]))
    row = np.searchsorted(edges, elevation, side="right") - 1
    row[(elevation < edges[0]) | (elevation >= edges[-1])] = -1
    turn = 2 * np.pi / sensor.azimuth_step
    real = (np.arctan2(p[:, 1], p[:, 0]) - sensor.first_azimuth) / sensor.azimuth_step
    column = np.floor((real + 0.5) % turn).astype(np.int64)
    column[column >= sensor.image_shape[1]] = -1
    return row, column, np.linalg.norm(p, axis=1)


def range_image(
    points_S: NDArray[np.float32], sensor: Sensor, range_min: float, range_max: float
) -> NDArray[np.float64]:
    """Give the nearest range of every cell; 0 where there is none."""
    points_S = points_S[np.isfinite(points_S).all(axis=1)]
    row, column, distance = cells(points_S, sensor)
    good = (row >= 0) & (column >= 0) & (distance >= range_min) & (distance <= range_max)
    image = np.full(sensor.image_shape, np.inf)
    np.minimum.at(image, (row[good], column[good]), distance[good])
    return np.where(np.isfinite(image), image, 0.0)


def angle(near: NDArray[np.float64], far: NDArray[np.float64], alpha: NDArray[np.float64]):
    """Give the paper's angle, Algorithm 1: between the far beam and the line from echo to echo."""
    return np.arctan2(near * np.sin(alpha), far - near * np.cos(alpha))


def labels(
    image: NDArray[np.float64], sensor: Sensor, theta: float, noise: float, bridged: int
) -> NDArray[np.int64]:
    """Give the components of a range image; -1 where there is no echo.

    The noise floor is taken off the far range before the paper's criterion is asked.
    """
    rows, columns = image.shape
    number = np.arange(image.size).reshape(image.shape)
    links: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = []
    for gap in range(1, bridged + 2):
        c, s = np.cos(sensor.elevations), np.sin(sensor.elevations)
        alpha = np.arccos(s**2 + c**2 * np.cos(gap * sensor.azimuth_step))[:, None]
        beside = np.roll(image, -gap, axis=1)
        open_between = np.all([np.roll(image, -k, axis=1) == 0 for k in range(1, gap)], axis=0)
        ok = _linked(image, beside, alpha, theta, noise) & open_between
        if not sensor.wraps:
            ok[:, columns - gap :] = False
        links.append((number[ok], np.roll(number, -gap, axis=1)[ok]))
        if gap < rows:
            low, high = image[:-gap], image[gap:]
            alpha = (sensor.elevations[gap:] - sensor.elevations[:-gap])[:, None]
            between = [image[k : rows - gap + k] == 0 for k in range(1, gap)]
            ok = _linked(low, high, alpha, theta, noise) & np.all(between, axis=0)
            links.append((number[:-gap][ok], number[gap:][ok]))
    a, b = (np.concatenate(side) for side in zip(*links, strict=True))
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(image.size, image.size))
    _, component = connected_components(graph, directed=False)
    return np.where(image > 0, component.reshape(image.shape), -1)


def _linked(p, q, alpha, theta: float, noise: float):
    far, near = np.maximum(p, q) - noise, np.minimum(p, q)
    return (p > 0) & (q > 0) & (angle(near, far, alpha) > theta)


def same_partition(a: NDArray[np.int64], b: NDArray[np.int64]) -> bool:
    """Are the same cells together in both?"""
    used = a >= 0
    if not np.array_equal(used, b >= 0):
        return False
    pairs = np.unique(np.stack([a[used], b[used]]), axis=1)
    return len(np.unique(a[used])) == len(np.unique(b[used])) == pairs.shape[1]
