"""From a scenario and a moment to what a LiDAR can see."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.bodies import Bodies
from twinscrew.hil_sim.buoys import floating
from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.sea.sea import Sea
from twinscrew.hil_sim.shapes import (
    Shape,
    boxes_shape,
    joined,
    load_shape,
    posts_shape,
    vessel_shape,
    walls_shape,
)
from twinscrew.hil_sim.traffic import Traffic, shape_of
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.vessel_description import VesselDescription

VESSEL, BUOY, QUAYS = 0, 1, 2
"""Numbers of the shapes; further kinds of vessels come after them."""
QUAY_DRAUGHT = 2.0
"""[m] How far quays, land and piles reach below the water at rest: deeper than any trough."""


def shapes(scenario: Scenario, vessels: Sequence[VesselDescription]) -> tuple[Shape, ...]:
    """Give the shapes of everything in a scenario, in the order of their numbers."""
    kinds = list({vessel.key: vessel for vessel in vessels}.values())
    first, *further = [vessel_shape(kind) for kind in kinds]
    quays = [_standing(scenario)] if stands(scenario) else []
    traffic = [shape_of(entry) for entry in scenario.traffic]
    return (first, load_shape("light_buoy"), *quays, *further, *traffic)


def shape_numbers(scenario: Scenario, vessels: Sequence[VesselDescription]) -> NDArray[np.int64]:
    """Give the number of each vessel's shape, (V,), among `shapes`."""
    kinds = list(dict.fromkeys(vessel.key for vessel in vessels))
    after = QUAYS + int(stands(scenario)) - 1
    kind = np.array([kinds.index(vessel.key) for vessel in vessels])
    return np.where(kind == 0, VESSEL, after + kind)


def bodies(
    scenario: Scenario,
    state: VesselState,
    shapes: NDArray[np.int64],
    sea: Sea,
    time_s: float,
    traffic: Traffic | None = None,
    first_traffic: int = 0,
) -> Bodies:
    """Give everything that can be seen: vessels, buoys, all that stands as one body, then traffic.

    `shapes`, (V,), are the numbers of the vessels' shapes, or `ABSENT`; scripted ships have those
    from `first_traffic` on.
    """
    B, Q = len(scenario.buoys), int(stands(scenario))
    shape = np.concatenate([shapes, np.full(B, BUOY), np.full(Q, QUAYS)]).astype(np.int32)
    afloat = floating(scenario.buoys[:, :2], sea, time_s)
    upright = np.broadcast_to(np.eye(3), (B + Q, 3, 3))
    R_NB, still = rotations(state.q_NB), np.zeros((B + Q, 3))
    velocity_N = np.einsum("vij,vj->vi", R_NB, state.velocity_B)
    seen = Bodies(
        shape=shape,
        position_N=np.concatenate([state.position_N, afloat, np.zeros((Q, 3))]),
        R_NB=np.concatenate([R_NB, upright]),
        water_z=np.concatenate(
            [-sea.elevation(state.position_N[:, :2], time_s), afloat[:, 2], np.zeros(Q)]
        ),
        velocity_N=np.concatenate([velocity_N, still]),
        rates_B=np.concatenate([state.rates_B, still]),
    )
    return seen if traffic is None else _with_traffic(seen, traffic, first_traffic, sea, time_s)


def _with_traffic(seen: Bodies, traffic: Traffic, first: int, sea: Sea, time_s: float) -> Bodies:
    """Add scripted ships, which are too heavy to move in the waves."""
    count = len(traffic)
    p_N, heading = traffic.position_N, traffic.heading
    R_NB = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
    R_NB[:, 0, 0] = R_NB[:, 1, 1] = np.cos(heading)
    R_NB[:, 1, 0] = np.sin(heading)
    R_NB[:, 0, 1] = -R_NB[:, 1, 0]
    flat = np.zeros((count, 1))
    assert seen.velocity_N is not None  # noqa: S101  (made above)
    assert seen.rates_B is not None  # noqa: S101
    return Bodies(
        shape=np.concatenate([seen.shape, np.arange(first, first + count, dtype=np.int32)]),
        position_N=np.concatenate([seen.position_N, np.column_stack([p_N, flat])]),
        R_NB=np.concatenate([seen.R_NB, R_NB]),
        water_z=np.concatenate([seen.water_z, -sea.elevation(p_N, time_s)]),
        velocity_N=np.concatenate([seen.velocity_N, np.column_stack([traffic.velocity_N, flat])]),
        rates_B=np.concatenate([seen.rates_B, np.zeros((count, 3))]),
    )


def rotations(q_NB: Float64) -> Float64:
    """Give R_NB, (V, 3, 3), of unit quaternions, (V, 4). Fossen (2021), eq. 2.72."""
    w, x, y, z = q_NB.T
    R = np.empty((len(q_NB), 3, 3))
    R[:, 0, 0], R[:, 1, 1] = 1 - 2 * (y * y + z * z), 1 - 2 * (x * x + z * z)
    R[:, 2, 2] = 1 - 2 * (x * x + y * y)
    R[:, 0, 1], R[:, 1, 0] = 2 * (x * y - z * w), 2 * (x * y + z * w)
    R[:, 0, 2], R[:, 2, 0] = 2 * (x * z + y * w), 2 * (x * z - y * w)
    R[:, 1, 2], R[:, 2, 1] = 2 * (y * z - x * w), 2 * (y * z + x * w)
    return R


def stands(scenario: Scenario) -> bool:
    """Tell whether anything stands in the water: quays, land or piles."""
    return bool(len(scenario.quays) or scenario.land or len(scenario.piles))


def _standing(scenario: Scenario) -> Shape:
    parts = [
        _quays(scenario.quays),
        posts_shape(scenario.piles, QUAY_DRAUGHT),
        *(walls_shape(land.outline, land.height_m, QUAY_DRAUGHT) for land in scenario.land),
    ]
    return joined([part for part in parts if len(part.kinds)])


def _quays(quays: Float64) -> Shape:
    north, east, length, width, height, heading = quays.T
    depth = (QUAY_DRAUGHT - height) / 2  # down coordinate of the box's centre
    return boxes_shape(
        np.column_stack([north, east, depth]),
        np.column_stack([length, width, height + QUAY_DRAUGHT]),
        heading,
    )
