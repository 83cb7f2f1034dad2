"""Vessels on a collision course are announced early, and only those."""

import math

import numpy as np
import pytest

from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Odometry, Tracks
from twinscrew.runtime.safety.alarms import Alarms, AlarmSettings


def own(t: float, heading: float = 0.0, speed: float = 2.5) -> Odometry:
    way = speed * t * np.array([math.cos(heading), math.sin(heading), 0.0])
    return Odometry(
        stamp_ns=round(t * 1e9),
        position_N=way,
        q_NB=quaternion_from_euler(0.0, 0.0, heading),
        velocity_B=np.array([speed, 0.0, 0.0]),
        rates_B=np.zeros(3),
    )


def track(t, p_N, v_N, sigma_m=5.0, sigma_mps=0.15, number=7, **more) -> Tracks:
    P = np.diag([sigma_m**2, sigma_m**2, sigma_mps**2, sigma_mps**2])
    return Tracks(
        stamp_ns=round(t * 1e9),
        id=np.array([number]),
        p_N=np.array([p_N], float),
        v_N=np.array([v_N], float),
        radius=np.array([10.0]),
        covariance=P[None],
        age_s=np.zeros(1),
        **more,
    )


def sailed(p_N, v_N, seconds=150, *, settings=None, **more):
    """Sail straight for a while; give the events with their times [s]."""
    alarms, events = Alarms(settings), []
    for k in range(10 * seconds):
        t = 0.1 * k
        here = np.array(p_N) + np.array(v_N) * t
        events += [(t, e) for e in alarms.step(own(t), track(t, here, v_N, **more))]
    return events


def test_a_ship_of_5_m_s_on_a_collision_course_is_announced_a_minute_ahead():
    meets_s = 110.0
    p_N = np.array([2.5 * meets_s, 5.0 * meets_s])
    (when, event), *rest = sailed(p_N, (0.0, -5.0), name=("257123450 NORDLYS",))
    assert event.name == "collision_course"
    assert meets_s - when >= 60.0
    assert "257123450 NORDLYS" in event.detail
    assert "comes within 0 m" in event.detail
    assert [e.name for _, e in rest] == ["collision_course_over"]


@pytest.mark.parametrize("astern_m", [80.0, -80.0, 200.0])
def test_a_ship_whose_bearing_changes_is_not_announced(astern_m):
    meets_s = 110.0
    p_N = np.array([2.5 * meets_s + astern_m, 5.0 * meets_s])
    assert sailed(p_N, (0.0, -5.0)) == []


def test_what_is_not_known_well_is_not_announced():
    assert sailed((275.0, 550.0), (0.0, -5.0), 20, sigma_mps=3.0) == []


def test_what_opens_or_keeps_its_distance_is_not_announced():
    assert sailed((50.0, 0.0), (2.5, 0.0)) == []
    assert sailed((-50.0, 0.0), (1.0, 0.0), 100) == []


def test_an_alarm_is_given_once_and_ends_once():
    names = [e.name for _, e in sailed((275.0, 550.0), (0.0, -5.0), 200)]
    assert names == ["collision_course", "collision_course_over"]


def test_alarms_can_be_switched_off():
    off = AlarmSettings(enabled=False)
    assert sailed((275.0, 550.0), (0.0, -5.0), 120, settings=off) == []
