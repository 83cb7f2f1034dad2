"""The reward, eq. (16), against hand-computed cases."""

from __future__ import annotations

import math

import numpy as np
import pytest

from twinscrew.training.environment import RewardSettings, colregs_turn, reward

RADIUS = 2.795
NORTH = np.array([[[2.0, 0.0]]])
HEAD_ON = (10.0, 0.0, -2.0, 0.0, 2.0)
STATIC = (5.0, 0.0, 0.1, 0.0, 1.0)
HARMLESS = (4.0, -4.0, 2.0, 0.0, 2.0)  # sails along


def scene(*objects: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    rows = np.zeros((1, 1, 5, 5), np.float32)
    mask = np.zeros((1, 1, 5), np.float32)
    rows[0, 0, : len(objects)] = objects
    mask[0, 0, : len(objects)] = 1.0
    return rows, mask


def test_every_term_counts_as_in_the_paper() -> None:
    true, false = np.array([[True]]), np.array([[False]])
    progress, turn = np.array([[1.5]]), np.array([[0.5]])
    settings = RewardSettings()
    assert reward(progress, false, false, turn, settings) == pytest.approx(-0.1 + 1.5 - 0.05)
    assert reward(progress, true, false, 0 * turn, settings) == pytest.approx(-0.1 + 1.5 - 5.0)
    assert reward(progress, false, true, 0 * turn, settings) == pytest.approx(-0.1 + 1.5 + 10.0)
    harsh = RewardSettings(collision=-60.0)
    assert reward(0 * progress, true, false, 0 * turn, harsh) == pytest.approx(-60.1)


def test_a_head_on_meeting_asks_for_the_angle_to_the_compliant_course() -> None:
    expected = math.asin(0.3) + math.atan2(RADIUS, math.sqrt(91.0))
    turn = colregs_turn(*scene(HEAD_ON), NORTH, RADIUS, RewardSettings())
    assert turn[0, 0] == pytest.approx(expected)


def test_static_objects_are_no_vessels() -> None:
    near_buoy = colregs_turn(*scene(STATIC, HEAD_ON), NORTH, RADIUS, RewardSettings())
    assert near_buoy[0, 0] > 0.5
    assert colregs_turn(*scene(STATIC), NORTH, RADIUS, RewardSettings())[0, 0] == 0.0


def test_the_paper_checks_the_closest_vessel_and_the_reference_the_first_that_qualifies() -> None:
    both = scene(HARMLESS, HEAD_ON)
    assert colregs_turn(*both, NORTH, RADIUS, RewardSettings(which="closest"))[0, 0] == 0.0
    assert colregs_turn(*both, NORTH, RADIUS, RewardSettings(which="first"))[0, 0] > 0.5


def test_of_two_that_qualify_the_nearer_counts() -> None:
    far = (16.0, 0.0, -2.0, 0.0, 2.0)
    alone = colregs_turn(*scene(HEAD_ON), NORTH, RADIUS, RewardSettings(which="first"))
    both = colregs_turn(*scene(HEAD_ON, far), NORTH, RADIUS, RewardSettings(which="first"))
    assert both[0, 0] == alone[0, 0]


def test_padding_is_nobody() -> None:
    objects, mask = scene(HEAD_ON)
    assert colregs_turn(objects, 0 * mask, NORTH, RADIUS, RewardSettings())[0, 0] == 0.0
