"""A decision's objects and tracks as the page draws them: in frame N, with what COLREGs ask."""

from __future__ import annotations

import numpy as np

from twinscrew.hil_sim.viewer.wire import TrackView
from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import Float64, Objects, Odometry, Tracks
from twinscrew.runtime.policy.colregs import situation

Circle = tuple[float, float, float]


def track_views(tracks: Tracks, position_N: Float64, velocity_N: Float64) -> tuple[TrackView, ...]:
    """Give the tracks.

    Parameters
    ----------
    tracks
        A vessel's.
    position_N, velocity_N : (2,) float64
        That vessel's place [m] and velocity over ground [m/s], frame N.
    """
    v_ego = np.broadcast_to(velocity_N, tracks.v_N.shape)
    asked = situation(tracks.p_N - position_N, tracks.v_N, v_ego)
    numbers = np.column_stack([tracks.p_N, tracks.v_N, tracks.radius, tracks.age_s]).round(2)
    rows = zip(tracks.id.tolist(), numbers.tolist(), asked.tolist(), strict=True)
    return tuple(
        TrackView(id_, north, east, v_north, v_east, radius, unseen_s, rule)
        for id_, (north, east, v_north, v_east, radius, unseen_s), rule in rows
    )


def object_views(objects: Objects, odometry: Odometry) -> tuple[Circle, ...]:
    """Give what perception found: north, east, radius [m]."""
    p_N = odometry.position_N[:2] + objects.p_L @ rotation_2d(odometry.heading).T
    rows = np.column_stack([p_N, objects.radius]).round(2)
    return tuple((north, east, radius) for north, east, radius in rows.tolist())


def pair(values: Float64) -> tuple[float, float]:
    """Give two numbers in hundredths: nobody sees less."""
    first, second = values.round(2).tolist()
    return first, second
