"""Odometry whose frames are mixed up, in each of the ways in which drivers do that."""

from dataclasses import replace

import numpy as np
import pytest

from twinscrew.runtime.doctor.checks import Verdict
from twinscrew.runtime.doctor.listening import judge_motion, motion_of
from twinscrew.runtime.geometry import quaternion_from_euler, rotation_from_quaternion
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Odometry

STEP_S = 0.05


def sail(speed=1.5, rate=0.3, heading=0.7, seconds=4.0):
    """Give the odometry of a boat in a turn, exactly."""
    series, position = [], np.array([3.0, -8.0, 0.1])
    for i in range(int(seconds / STEP_S)):
        q_NB = quaternion_from_euler(0.02, -0.01, heading + rate * i * STEP_S)
        series.append(
            Odometry(
                stamp_ns=1_800_000_000_000_000_000 + round(1e9 * i * STEP_S),
                position_N=position,
                q_NB=q_NB,
                velocity_B=np.array([speed, 0.0, 0.0]),
                rates_B=np.array([0.0, 0.0, rate]),
            )
        )
        midway = quaternion_from_euler(0.02, -0.01, heading + rate * (i + 0.5) * STEP_S)
        position = position + STEP_S * rotation_from_quaternion(midway) @ series[-1].velocity_B
    return series


def verdict(series):
    return judge_motion([cdr.encode_odometry(odometry) for odometry in series])


def test_a_boat_that_moves_as_it_says_is_fine():
    found = verdict(sail())
    assert found.verdict is Verdict.OK
    assert "5.9 m, 68 deg" in found.found


def test_positions_and_velocities_of_the_same_motion_agree():
    motion = motion_of(sail())
    assert motion.way_m == pytest.approx(motion.told_m, rel=1e-3)
    assert abs(motion.astray_rad) < 1e-3
    assert motion.turn_rad == pytest.approx(motion.told_turn_rad, rel=1e-6)


def test_velocities_in_the_worlds_frame_are_found():
    turned = [
        replace(o, velocity_B=rotation_from_quaternion(o.q_NB) @ o.velocity_B) for o in sail()
    ]
    found = verdict(turned)
    assert found.verdict is Verdict.FAIL
    assert "vessel's frame" in found.advice


def test_a_heading_from_east_that_is_taken_for_one_from_north_is_found():
    series = sail()
    quarter = quaternion_from_euler(0.0, 0.0, np.pi / 2)
    wrong = [replace(o, q_NB=product(quarter, o.q_NB)) for o in series]
    found = verdict(wrong)
    assert found.verdict is Verdict.FAIL
    assert "-90 deg" in found.found


def product(a, b):
    w, v = a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.concatenate([[w], v])


def test_a_yaw_rate_of_the_other_sign_is_found():
    flipped = [replace(o, rates_B=-o.rates_B) for o in sail()]
    found = verdict(flipped)
    assert found.verdict is Verdict.FAIL
    assert "other sign" in found.found


@pytest.mark.parametrize("factor", [0.0, 0.51, 3.6])
def test_a_twist_that_is_empty_or_in_knots_or_in_kilometres_an_hour_is_found(factor):
    wrong = [replace(o, velocity_B=factor * o.velocity_B) for o in sail()]
    found = verdict(wrong)
    assert found.verdict is Verdict.FAIL
    assert "m/s" in found.advice


def test_a_boat_that_drifts_sideways_is_a_warning_only():
    drifting = sail(rate=0.0)
    aside = [
        replace(
            o,
            q_NB=quaternion_from_euler(0.0, 0.0, o.heading - np.pi / 2),
            velocity_B=np.array([0.0, 1.5, 0.0]),
        )
        for o in drifting
    ]
    found = verdict(aside)
    assert found.verdict is Verdict.WARN
    assert "90 deg clockwise of where it points" in found.found


def test_a_boat_at_rest_tells_nothing_and_the_doctor_says_what_to_do():
    found = verdict(sail(speed=0.0, rate=0.0))
    assert found.verdict is Verdict.WARN
    assert "push the boat" in found.advice


def test_one_message_or_a_malformed_one_fails():
    assert verdict(sail()[:1]).verdict is Verdict.FAIL
    assert judge_motion([b"no odometry", b"at all"]).verdict is Verdict.FAIL
