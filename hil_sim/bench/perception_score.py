"""How well objects agree with the truth of a simulated scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.bench.perception_scenes import QUAY, RADII, Scene
from twinscrew.hil_sim.lidar import Scan
from twinscrew.runtime.messages.types import Float64, Objects
from twinscrew.runtime.perception.segmentation import Perception

PURITY = 0.9
"""[-] Share of an own cluster's echoes that must come from the object."""
SHARE = 0.5
"""[-] Share of the object's echoes that its own cluster must hold."""
FRAGMENT = 0.1
"""[-] A second circle with this share of the object's echoes makes it split."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """One true object that gave enough echoes to be found, and what became of it."""

    distance: float
    """[m] From the own vessel's origin to its."""
    found: bool
    """It has an own cluster: at least `PURITY` its echoes, and at least `SHARE` of them."""
    split: bool
    """More than one circle holds a share of it."""
    merged: bool
    """The circle that holds most of it holds other things too."""
    position_error: float
    """[m] From its origin to its own cluster's centre; NaN if not found."""
    radius_error: float
    """[m] Its own cluster's radius less its collision radius; NaN if not found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """What became of one scan."""

    truths: list[Truth]
    circles: int
    """[-] Circles reported."""
    false: int
    """[-] Circles that are neither an object's own cluster nor a piece of a quay."""
    on_hull: int
    """[-] Circles that hold the own vessel's origin."""


def score(perception: Perception, scene: Scene, scan: Scan, objects: Objects) -> Score:
    """Compare the objects of the scan just perceived with the scene."""
    body, circle = labelled_echoes(perception, scan)
    counts = echo_counts(body, circle, len(scene.bodies.shape), len(objects.radius))
    own = counts / np.maximum(counts.sum(axis=0), 1)  # purity of each circle for each body
    visible = np.bincount(body[body >= 0], minlength=len(scene.bodies.shape))
    least = perception.settings.min_points
    truths, claimed = [], np.zeros(len(objects.radius), dtype=bool)
    for number, kind in enumerate(scene.bodies.shape):
        if number == 0 or kind >= QUAY or visible[number] < least:
            continue
        truth, best = _judge(scene, objects, counts[number] / visible[number], own[number], number)
        truths.append(truth)
        if truth.found:
            claimed[best] = True
    pieces = own[:-1][scene.bodies.shape >= QUAY].sum(axis=0) >= PURITY
    holding = np.hypot(*objects.p_L.T) < objects.radius
    return Score(
        truths=truths,
        circles=len(claimed),
        false=int(np.sum(~claimed & ~pieces)),
        on_hull=int(holding.sum()),
    )


def labelled_echoes(
    perception: Perception, scan: Scan
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Give the body and the circle (-1: none) of every echo in the range image."""
    points = perception.point_image()
    used = points >= 0
    return scan.object_ids[points[used]], perception.object_image()[used]


def echo_counts(
    body: NDArray[np.int32], circle: NDArray[np.int32], bodies: int, circles: int
) -> NDArray[np.int64]:
    """Count each body's echoes in each circle, (bodies + 1, circles); the last row is water."""
    table = np.zeros((bodies + 1, circles), dtype=np.int64)
    inside = circle >= 0
    np.add.at(table, (np.where(body < 0, bodies, body)[inside], circle[inside]), 1)
    return table


def body_frame(scene: Scene, number: int) -> Float64:
    """Give where a body's origin is, (2,) [m], in the levelled frame of body 0."""
    p_N, forward = scene.bodies.position_N, scene.bodies.R_NB[0][:2, 0]
    x, y = forward / np.hypot(*forward)
    offset: Float64 = (p_N[number] - p_N[0])[:2]
    return np.array([[x, y], [-y, x]]) @ offset


def _judge(
    scene: Scene, objects: Objects, shares: Float64, purities: Float64, number: int
) -> tuple[Truth, int]:
    """Judge one true object by its share in each circle and its purity there."""
    p_L = body_frame(scene, number)
    best = int(np.argmax(shares)) if len(shares) else -1
    found = best >= 0 and bool(shares[best] >= SHARE and purities[best] >= PURITY)
    off = float(np.hypot(*(objects.p_L[best] - p_L))) if found else np.nan
    true_radius = RADII[int(scene.bodies.shape[number])]
    truth = Truth(
        distance=float(np.hypot(*p_L)),
        found=found,
        split=int(np.sum(shares >= FRAGMENT)) > 1,
        merged=best >= 0 and bool(shares[best] > 0.0 and purities[best] < PURITY),
        position_error=off,
        radius_error=float(objects.radius[best]) - true_radius if found else np.nan,
    )
    return truth, best
