"""How a tracked object moves, and how the visible side of it wanders: the filter's model.

The state is x = (north, east, v_north, v_east, b_along, b_across): the object's centre and
velocity in frame N, and b, the distance of the *visible* centroid from that centre beyond what is
expected of it, along and across the line of sight. A LiDAR sees the side that faces it. As the
aspect changes the visible centroid slides over the hull, and a filter that took this for white
noise would report a velocity that is not there, and be sure of it. Position and velocity follow the
white-noise acceleration model; b is a first-order Gauss-Markov process.

Source: Bar-Shalom, Li, Kirubarajan (2001), Estimation with Applications to Tracking and Navigation,
sec. 6.2.2 (white-noise acceleration) and 8.2 (autocorrelated noise by state augmentation).
"""

from __future__ import annotations

import math

import numpy as np

from twinscrew.runtime.messages.types import Float64

STATES = 6


def transition(dt: float, bias_time_s: float) -> Float64:
    """Give F, (6, 6), over `dt` [s] for a bias that forgets with time constant `bias_time_s`."""
    F = np.eye(STATES)
    F[0, 2] = F[1, 3] = dt
    F[4, 4] = F[5, 5] = math.exp(-dt / bias_time_s)
    return F


def motion_noise(dt: float, acceleration_psd: float) -> Float64:
    """Give the part of Q, (6, 6), of a white acceleration of this density [m2/s3] over `dt` [s].

    Bar-Shalom et al. (2001), eq. 6.2.2-4, one block an axis.
    """
    Q = np.zeros((STATES, STATES))
    position = acceleration_psd * dt**3 / 3
    cross = acceleration_psd * dt**2 / 2
    velocity = acceleration_psd * dt
    for axis in (0, 1):
        Q[axis, axis] = position
        Q[axis, axis + 2] = Q[axis + 2, axis] = cross
        Q[axis + 2, axis + 2] = velocity
    return Q


def bias_noise(dt: float, bias_time_s: float, variance: Float64) -> Float64:
    """Give the part of Q, (K, 6, 6), that keeps the biases' stationary variances.

    Parameters
    ----------
    dt : float
        Time step [s].
    bias_time_s : float
        Time constant [s].
    variance : (K, 2) float64
        Stationary variances [m2], along and across the line of sight.
    """
    Q = np.zeros((len(variance), STATES, STATES))
    forgotten = 1.0 - math.exp(-2.0 * dt / bias_time_s)
    Q[:, 4, 4], Q[:, 5, 5] = forgotten * variance.T
    return Q


def slide_noise(dt: float, slide_mps: Float64) -> Float64:
    """Give the part of Q, (K, 6, 6), of places that jump over `dt` [s] without any velocity.

    Parameters
    ----------
    dt : float
        Time step [s].
    slide_mps : (K,) float64
        Standard deviation of the jumps over the time [m/s]; 0 for what goes where it is moved.
    """
    Q = np.zeros((len(slide_mps), STATES, STATES))
    Q[:, 0, 0] = Q[:, 1, 1] = (slide_mps * dt) ** 2
    return Q
