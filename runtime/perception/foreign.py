"""Perception of other people's scans, whose sensor may not be quite the one described."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32, Float64, Objects, PointCloud
from twinscrew.runtime.perception.fit import fitted
from twinscrew.runtime.perception.sensor import Mount, Sensor
from twinscrew.runtime.perception.settings import PerceptionSettings
from twinscrew.runtime.perception.stage import Perception

HERE = Mount(x_m=0.0, y_m=0.0, z_m=0.0)
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
KEPT = 0.8
"""[-] A description that keeps a smaller share of the points of use does not fit the scan."""
LAYER_M = 0.2
"""[m] Half the thickness of a layer that may be the ground."""
GROUND_SHARE = 0.25
"""[-] With this share of the points, it probably is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chosen:
    """What perceives a scan."""

    perception: Perception
    fits: bool
    """False if the description keeps too few points, so that the image came from the points."""
    kept: float
    """[-] The share of the points of use for which the description has a cell."""


def choose(
    cloud: PointCloud, ring: NDArray[np.uint16] | None, sensor: Sensor, settings: PerceptionSettings
) -> Chosen:
    """Choose the image: the description's, or if that drops points, the one that keeps most."""
    described = Perception(sensor.mounted(HERE), settings)
    kept = _kept(described, cloud)
    if kept >= KEPT:
        return Chosen(perception=described, fits=True, kept=kept)
    others = [
        Perception(one.mounted(HERE), settings) for one in fitted(cloud.points_S, ring, sensor)
    ]
    best = max([described, *others], key=lambda one: _kept(one, cloud))
    return Chosen(perception=best, fits=best is described, kept=kept)


def _kept(perception: Perception, cloud: PointCloud) -> float:
    """Give the share of the points of use that get a cell of their own; 1 if there are none."""
    report = perception.project(cloud, LEVEL)
    of_use = report.used + report.hidden + report.no_beam
    return report.used / of_use if of_use else 1.0


def objects_S(perception: Perception, cloud: PointCloud, q_NS: Float64) -> Objects:
    """Perceive a scan taken in some attitude; give the objects in the sensor's own axes.

    Perception gives them in a levelled frame. Which echoes are whose stays; centroids and radii
    are taken anew, unless the sensor was level.
    """
    objects = perception.step(cloud, q_NS)
    if np.array_equal(q_NS, LEVEL):
        return objects
    number = perception.object_image()
    cells = number >= 0
    p, number = cloud.points_S[perception.point_image()[cells], :2].astype(float), number[cells]
    sums = [np.bincount(number, p[:, axis], len(objects.p_B)) for axis in (0, 1)]
    centre = np.stack(sums, axis=1) / objects.points[:, None]
    away = np.hypot(*(p - centre[number]).T)
    radius = np.zeros(len(centre))
    np.maximum.at(radius, number, away)
    return replace(objects, p_B=centre, radius=radius, strips=None)


def ground_below(points_S: Float32) -> float | None:
    """[m] Give how far below the sensor a layer with many of the points is; none if none is."""
    down = points_S[:, 2]
    down = down[(down > 2 * LAYER_M) & (down < 100.0)]
    if len(down) == 0:
        return None
    counts = np.bincount((down / (2 * LAYER_M)).astype(np.int64))
    middle = (int(np.argmax(counts)) + 0.5) * 2 * LAYER_M
    for _ in range(3):  # the layer is centred on what it holds
        layer = down[np.abs(down - middle) <= LAYER_M]
        middle = float(layer.mean()) if len(layer) else middle
    return middle if len(layer) >= GROUND_SHARE * len(points_S) else None
