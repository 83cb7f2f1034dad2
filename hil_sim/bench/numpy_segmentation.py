"""The segmentation as one writes it with numpy and scipy: the measure of the kernel's speed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from twinscrew.runtime.messages.types import Float32
from twinscrew.runtime.perception.segmentation import PerceptionSettings
from twinscrew.runtime.perception.sensor import Sensor


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


def labels(image: Float32, sensor: Sensor, settings: PerceptionSettings) -> NDArray[np.int32]:
    """Label the components of a range image, as the kernel does; -1 where there is no echo.

    The same links (neighbours along and across, over `bridged` missing echoes, with the noise
    floor), without trigonometry for each echo, so that it is the same work: tests hold the two to
    the same partition. Only the numbers of the components differ.
    """
    number = np.arange(image.size, dtype=np.int32).reshape(image.shape)
    links = [
        link
        for gap in range(1, min(settings.bridged + 1, *(n - 1 for n in image.shape)) + 1)
        for link in (
            _along(image, number, sensor, settings, gap),
            _across(image, number, sensor, settings, gap),
        )
    ]
    a, b = (np.concatenate(side) for side in zip(*links, strict=True))
    graph = coo_matrix((np.ones(len(a), np.int8), (a, b)), shape=(image.size, image.size))
    component: NDArray[np.int32] = connected_components(graph, directed=False)[1]
    return np.where(image > 0, component.reshape(image.shape), np.int32(-1))


Links = tuple[NDArray[np.int32], NDArray[np.int32]]


def _along(
    image: Float32,
    number: NDArray[np.int32],
    sensor: Sensor,
    settings: PerceptionSettings,
    gap: int,
) -> Links:
    """Give the links along rows between echoes `gap` columns apart with none between."""
    c, s = np.cos(sensor.elevations), np.sin(sensor.elevations)
    angle = np.arccos(s**2 + c**2 * np.cos(gap * sensor.azimuth_step))
    ok = _linked(
        image, np.roll(image, -gap, axis=1), _k(angle, settings)[:, None], sensor, settings
    )
    for between in range(1, gap):
        ok &= np.roll(image, -between, axis=1) == 0
    if not sensor.wraps:
        ok[:, -gap:] = False
    return number[ok], np.roll(number, -gap, axis=1)[ok]


def _across(
    image: Float32,
    number: NDArray[np.int32],
    sensor: Sensor,
    settings: PerceptionSettings,
    gap: int,
) -> Links:
    """Give the links between echoes `gap` rows apart with none between."""
    low, high = image[:-gap], image[gap:]
    angle = sensor.elevations[gap:] - sensor.elevations[:-gap]
    ok = _linked(low, high, _k(angle, settings)[:, None], sensor, settings)
    for between in range(1, gap):
        ok &= image[between : between - gap] == 0
    return number[:-gap][ok], number[gap:][ok]


def _k(angle: NDArray[np.float64], settings: PerceptionSettings) -> Float32:
    return (np.cos(angle) + np.sin(angle) / math.tan(settings.theta_rad)).astype(np.float32)


def _linked(
    p: Float32, q: Float32, k: Float32, sensor: Sensor, settings: PerceptionSettings
) -> NDArray[np.bool_]:
    noise = np.float32(settings.noise_sigmas * math.sqrt(2.0) * sensor.noise_sigma_m)
    near = np.minimum(p, q)
    linked: NDArray[np.bool_] = (near > 0) & (np.maximum(p, q) < k * near + noise)
    return linked
