"""The segmentation as one writes it with numpy and scipy: the measure of the kernel's speed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from twinscrew.runtime.messages.types import Float32
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.perception.stage import PerceptionSettings


def project(points_S: Float32, sensor: Sensor, settings: PerceptionSettings) -> Float32:
    """Put points into a range image, (M, W) [m]; 0 where there is no echo.

    It leaves out what the kernel also does: levelling, the masks of hull and water.
    """
    x, y, z = points_S.T
    flat = x * x + y * y
    distance = np.sqrt(flat + z * z)
    near = (distance >= sensor.range_min_m) & (distance <= settings.max_range_m)
    x, y, z, flat, distance = x[near], y[near], z[near], flat[near], distance[near]
    e = sensor.elevations
    edges = np.concatenate(
        [[1.5 * e[0] - 0.5 * e[1]], (e[1:] + e[:-1]) / 2, [1.5 * e[-1] - 0.5 * e[-2]]]
    )
    row = np.searchsorted(edges.astype(np.float32), np.arctan2(-z, np.sqrt(flat))) - 1
    turn = np.arctan2(y, x) - np.float32(sensor.first_azimuth)
    column = np.rint(turn / np.float32(sensor.azimuth_step)).astype(np.int64)
    column %= round(2 * math.pi / sensor.azimuth_step)
    good = (row >= 0) & (row < len(e)) & (column < sensor.image_shape[1])
    image = np.full(sensor.image_shape, np.inf, np.float32)
    np.minimum.at(image, (row[good], column[good]), distance[good])
    image[np.isinf(image)] = 0.0
    return image


def segment(image: Float32, sensor: Sensor, settings: PerceptionSettings) -> NDArray[np.int32]:
    """Label the components of a range image with the paper's 4 neighbours, without trigonometry.

    It links no neighbours across missing echoes (`bridged` 0): less work than the kernel does.
    """
    noise = np.float32(settings.noise_sigmas * math.sqrt(2.0) * sensor.noise_sigma_m)
    number = np.arange(image.size, dtype=np.int32).reshape(image.shape)
    rows = sensor.elevations
    c, s = np.cos(rows), np.sin(rows)
    along = _k(np.arccos(s**2 + c**2 * np.cos(sensor.azimuth_step)), settings.theta_rad)[:, None]
    across = _k(np.diff(rows), settings.theta_rad)[:, None]
    beside = np.roll(image, -1, axis=1)
    right = _linked(image, beside, along, noise)
    if not sensor.wraps:
        right[:, -1] = False
    up = _linked(image[:-1], image[1:], across, noise)
    a = np.concatenate([number[right], number[:-1][up]])
    b = np.concatenate([np.roll(number, -1, axis=1)[right], number[1:][up]])
    graph = coo_matrix((np.ones(len(a), np.int8), (a, b)), shape=(image.size, image.size))
    labels: NDArray[np.int32] = connected_components(graph, directed=False)[1]
    return np.where(image > 0, labels.reshape(image.shape), np.int32(-1))


def _k(angle: NDArray[np.float64], theta: float) -> Float32:
    return (np.cos(angle) + np.sin(angle) / math.tan(theta)).astype(np.float32)


def _linked(p: Float32, q: Float32, k: Float32, noise: np.float32) -> NDArray[np.bool_]:
    near = np.minimum(p, q)
    linked: NDArray[np.bool_] = (near > 0) & (np.maximum(p, q) < k * near + noise)
    return linked
