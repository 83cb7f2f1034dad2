import math

import pytest
import torch

from twinscrew.training.networks import (
    EGO_FEATURES,
    OBJECT_FEATURES,
    Scales,
    ego_features,
    object_features,
    raw_scales,
)

SCALES = Scales()


def encounter(ego=(0, 0), position=(10, 0), velocity=(0, 0), radius=1.0):
    """The features of one object, in SI units again."""
    state = torch.tensor([[30.0, 0.0, *ego, 0.0, 0.0, 0.0]])
    thing = torch.tensor([[[*position, *velocity, radius]]], dtype=torch.float32)
    row = object_features(state, thing, SCALES)[0, 0].tolist()
    assert len(row) == OBJECT_FEATURES
    return {
        "direction": row[5:7],
        "relative": [v * SCALES.speed_mps for v in row[7:9]],
        "gap": row[9] * SCALES.length_m,
        "near": row[10],
        "closing": row[11] * SCALES.speed_mps,
        "time": row[12] * SCALES.time_s,
        "miss": row[13] * SCALES.gap_m,
    }


def test_the_gap_is_between_the_hulls():
    assert encounter(position=(6, 8), radius=2.0)["gap"] == pytest.approx(10 - 2 - 2.795, abs=1e-4)


def test_the_relative_velocity_is_over_ground_minus_our_own():
    assert encounter(ego=(2, 0.5), velocity=(-1, 0))["relative"] == pytest.approx([-3, -0.5])


def test_two_vessels_head_on_meet_when_their_distance_is_sailed():
    seen = encounter(ego=(2, 0), position=(12, 0), velocity=(-1, 0))
    assert seen["closing"] == pytest.approx(3.0, abs=1e-4)
    assert seen["time"] == pytest.approx(4.0, abs=1e-2)
    assert seen["miss"] == pytest.approx(-1 - 2.795, abs=0.01)


def test_a_crossing_vessel_is_missed_by_what_geometry_says():
    # We sail north at 2; it lies 10 m north, 10 m west and sails east at 1: relative (-2, 1),
    # closest after (20 + 10) / 5 = 6 s at (-2, -4).
    seen = encounter(ego=(2, 0), position=(10, -10), velocity=(0, 1))
    assert seen["time"] == pytest.approx(6.0, abs=1e-2)
    assert seen["miss"] == pytest.approx(math.hypot(2, 4) - 1 - 2.795, abs=0.01)


def test_what_recedes_is_closest_now():
    seen = encounter(position=(5, 0), velocity=(2, 0))
    assert seen["closing"] < 0
    assert seen["time"] == 0.0
    assert seen["miss"] == pytest.approx(seen["gap"], abs=1e-4)


def test_closeness_grows_to_one_at_contact():
    assert encounter(position=(3.795, 0))["near"] == pytest.approx(1.0, abs=1e-3)
    assert encounter(position=(8.795, 0))["near"] == pytest.approx(0.5, abs=1e-3)


def test_features_and_their_slopes_are_finite_at_no_distance_and_at_rest():
    ego = torch.zeros(1, 7, requires_grad=True)
    objects = torch.zeros(1, 5, 5, requires_grad=True)
    features = object_features(ego, objects, SCALES).sum() + ego_features(ego, SCALES).sum()
    features.backward()
    assert torch.isfinite(features)
    assert torch.isfinite(ego.grad).all()
    assert torch.isfinite(objects.grad).all()


def test_the_goal_is_given_by_direction_and_distance():
    row = ego_features(torch.tensor([[3.0, -4.0, 0, 0, 0, 0, 0]]), SCALES)[0].tolist()
    assert len(row) == EGO_FEATURES
    assert row[7:9] == pytest.approx([0.6, -0.8], abs=1e-4)
    assert row[9] == pytest.approx(5.0 / 20.0, abs=1e-4)


def test_raw_scales_bring_full_scale_to_one():
    ego, objects = raw_scales(SCALES)
    assert (ego * torch.tensor([20, 20, 3, 3, 0.7, 1000, 1000])).tolist() == pytest.approx([1] * 7)
    assert (objects * torch.tensor([20, 20, 3, 3, 20])).tolist() == pytest.approx([1] * 5)
