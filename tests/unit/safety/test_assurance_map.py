"""The assurance and the map: no contact with what is fixed by its own doing, and a way out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.unit.safety.test_assurance_contact import circles, straight

from twinscrew.runtime.charts.static_map import Area, Disc, StaticMap
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Float64, Odometry, Tracks
from twinscrew.runtime.safety.assurance import Assurance, AssuranceSettings
from twinscrew.runtime.safety.prediction import (
    FIXED,
    AssuranceVessel,
    Circles,
    Contact,
    Foresight,
    Motion,
)

DT = 0.1
VESSEL = AssuranceVessel()
WALL = np.array([[[10.0, 50.0], [10.0, -50.0]]])
"""Along y; what is forbidden lies beyond it, to its left."""


def quay(low: tuple[float, float], high: tuple[float, float], kind="land", **more) -> Area:
    (n0, e0), (n1, e1) = low, high
    outline = np.array([[n0, e0], [n1, e0], [n1, e1], [n0, e1]])
    return Area(kind=kind, outline=outline, **more)


def tracks(stamp_ns: int, *places: tuple[float, float], radius: float = 2.5) -> Tracks:
    count = len(places)
    return Tracks(
        stamp_ns=stamp_ns,
        id=np.arange(count),
        p_N=np.array(places).reshape(-1, 2),
        v_N=np.zeros((count, 2)),
        radius=np.full(count, radius),
        covariance=np.zeros((count, 4, 4)),
        age_s=np.zeros(count),
    )


def contact(path: Float64, around: Circles, hull=((0.0, 2.8),)) -> Contact:
    vessel = AssuranceVessel(hull=hull, close_hull=hull)
    rules = {"steps": 1, "dt": DT, "slew_nps": 1e3, "margin_m": 0.5, "approach_per_s": 1.0}
    return Foresight(vessel, **rules).contact(path, around)


class Boat:
    """The assurance's own model of the vessel, and nothing in between."""

    def __init__(self, chart: StaticMap, place: tuple[float, float], heading: float) -> None:
        self.assurance = Assurance(AssuranceSettings(disturbance_limit_n=0.0))
        self.assurance.static_map = chart
        self.chart = chart
        self.pose = np.array([*place, heading])
        self.nu = np.zeros(3)
        self.thrust = np.zeros(2)
        self.time_s = 0.0
        self.events: list[str] = []
        self._model = Foresight(
            VESSEL, steps=1, dt=DT, slew_nps=1e9, margin_m=0.0, approach_per_s=0.0
        )

    @property
    def odometry(self) -> Odometry:
        return Odometry(
            stamp_ns=round(self.time_s * 1e9),
            position_N=np.array([*self.pose[:2], 0.0]),
            q_NB=quaternion_from_euler(0.0, 0.0, self.pose[2]),
            velocity_B=np.array([*self.nu[:2], 0.0]),
            rates_B=np.array([0.0, 0.0, self.nu[2]]),
        )

    def step(self, command: tuple[float, float], *seen: tuple[float, float]) -> None:
        odometry = self.odometry
        around = tracks(odometry.stamp_ns, *seen)
        self.thrust, events = self.assurance.step(
            odometry, around, self.thrust, np.array(command), decided=True
        )
        self.events += [event.detail for event in events]
        u, v, r = self.nu
        change = self._model.acceleration(Motion(u, v, r), tuple(self.thrust.tolist()))
        before, self.nu = self.nu, self.nu + DT * np.array(change)
        u, v, r = (before + self.nu) / 2
        turn = self.pose[2] + DT * r / 2
        cosine, sine = math.cos(turn), math.sin(turn)
        self.pose += DT * np.array([cosine * u - sine * v, sine * u + cosine * v, r])
        self.time_s += DT

    def gap_m(self) -> float:
        """From the hull to what is forbidden; negative where they overlap."""
        ahead = np.array([math.cos(self.pose[2]), math.sin(self.pose[2])])
        places: Float64 = self.pose[:2] + np.array([[a] for a, _ in VESSEL.close_hull]) * ahead
        return float((self.chart.distance_m(places) - [r for _, r in VESSEL.close_hull]).min())


def test_a_wall_is_met_where_a_row_of_small_circles_would_be() -> None:
    path = straight(3.0, 30)  # up to a metre before it
    wall = replace(circles(), shores_L=WALL, shore_margin_m=0.5, shore_horizon_s=4.0)
    row = circles(*((10.01, y, 0.0, 0.0, 0.01) for y in np.arange(-8.0, 8.0, 0.01)))
    met, expected = contact(path, wall), contact(path, row)
    assert met.track == FIXED
    assert met.excess == pytest.approx(expected.excess, rel=1e-3)
    assert (met.time_s, met.speed_mps) == pytest.approx((expected.time_s, expected.speed_mps))


def test_who_is_where_it_is_forbidden_may_go_out_but_not_farther_in() -> None:
    wall = replace(circles(), shores_L=WALL, shore_margin_m=0.5, shore_horizon_s=4.0)
    inside = straight(1.0) + np.array([12.0, 0.0, 0.0])
    out = straight(-1.0) + np.array([12.0, 0.0, 0.0])
    still = straight(0.0) + np.array([12.0, 0.0, 0.0])
    assert contact(out, wall).excess < contact(still, wall).excess < contact(inside, wall).excess
    assert contact(out[:15], wall).excess == 0.0


@given(st.floats(-math.pi, math.pi), st.floats(0.3, 3.0), st.floats(-20.0, 20.0))
@settings(max_examples=100, deadline=None)
def test_a_corner_has_an_outside_and_an_inside(angle: float, size: float, north: float) -> None:
    """Around the corners of a sharp wedge: outside, closing in is judged; inside, going out is."""
    corner = np.array([north, 0.0])
    ways = [np.array([math.cos(a), math.sin(a)]) for a in (angle - size / 2, angle + size / 2)]
    wedge = StaticMap.of(
        [
            Area(
                kind="land",
                outline=np.array([corner, corner + 30 * ways[0], corner + 30 * ways[1]]),
            )
        ]
    )
    away = np.array([math.cos(angle), math.sin(angle)])
    around = replace(circles(), shores_L=wedge.edges, shore_margin_m=0.5, shore_horizon_s=4.0)
    steps = np.arange(0, 41)[:, None] * DT

    def path(start: Float64, way: Float64) -> Float64:
        return np.column_stack([start + steps * way, np.zeros(len(steps))])

    hull = ((0.0, 0.2),)
    outside, inside = corner - 2.0 * away, corner + 0.3 * away
    assert contact(path(outside, away), around, hull).excess > 0.0
    assert contact(path(outside, -away), around, hull).excess == 0.0
    assert contact(path(inside, -2.0 * away), around, hull).excess == 0.0
    assert contact(path(inside, away), around, hull).excess > 0.0


@pytest.mark.parametrize("kind", ["land", "fence"])
@pytest.mark.parametrize("heading_deg", [0.0, 30.0, -50.0])
def test_full_ahead_into_what_is_fixed_ends_before_it(kind: str, heading_deg: float) -> None:
    boat = Boat(
        StaticMap.of([quay((25, -60), (35, 60), kind)]), (0.0, 0.0), math.radians(heading_deg)
    )
    least = math.inf
    for _ in range(300):
        boat.step((1000.0, 1000.0))
        least = min(least, boat.gap_m())
    assert least > -0.02
    assert any("what is fixed" in detail for detail in boat.events)


def test_within_a_fence_that_is_not_convex_no_command_gets_out() -> None:
    ring = np.array([[0, 0], [60, 0], [60, 60], [35, 60], [35, 20], [25, 20], [25, 60], [0, 60]])
    chart = StaticMap.of([Area(kind="fence", outline=ring.astype(float), keep_in=True)])
    rng = np.random.default_rng(5)
    for _ in range(3):
        boat = Boat(chart, (12.0, 30.0), float(rng.uniform(-math.pi, math.pi)))
        least = math.inf
        for step in range(400):
            if step % 20 == 0:
                command = tuple(rng.choice([1000.0, 1000.0, -500.0, 300.0], 2).tolist())
            boat.step(command)
            least = min(least, boat.gap_m())
        assert least > -0.02


@pytest.mark.parametrize("depth_m", [0.5, 2.0, 4.0])
def test_a_boat_that_drifted_over_a_fence_gets_out_and_does_not_freeze(depth_m: float) -> None:
    chart = StaticMap.of([quay((0, -60), (40, 60), "keep_out")])
    boat = Boat(chart, (depth_m, 0.0), math.pi)  # its bow points out
    for _ in range(300):
        boat.step((300.0, 300.0) if boat.gap_m() < 1.0 else (0.0, 0.0))
        if boat.gap_m() > 0.3:
            return
    pytest.fail(f"still {boat.gap_m():.1f} m from being out")


def test_alongside_a_quay_it_may_pass_and_a_gap_of_1_6_beams_is_open() -> None:
    chart = StaticMap.of([quay((20, -60), (24, -2.0)), quay((20, 2.0), (24, 60))])
    boat = Boat(chart, (0.0, 0.0), 0.0)
    for _ in range(250):
        boat.step((500.0, 500.0), (22.0, -4.0), (22.0, 4.0))  # the tracker sees circles on land
        assert boat.gap_m() > 0.0
    assert boat.pose[0] > 40.0
    assert not any("intervened" in event for event in boat.events)


def test_what_lies_afloat_beside_the_land_is_still_an_object() -> None:
    chart = StaticMap.of(
        [quay((20, -60), (24, 60)), Disc(kind="hazard", centre=(-50.0, 0.0), radius_m=1.0)]
    )
    boat = Boat(chart, (0.0, 0.0), 0.0)
    for _ in range(200):
        boat.step((1000.0, 1000.0), (16.0, 0.0))
    bow_m = boat.pose[0] + max(ahead + radius for ahead, radius in VESSEL.hull)
    assert bow_m < 16.0 - 2.5 + 0.1
    assert any("track" in detail for detail in boat.events)
