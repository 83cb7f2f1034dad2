"""The simulator's native kernels (hil_sim/native)."""

import numpy as np
from numpy.typing import NDArray

class Caster:
    """A LiDAR's scan by ray casting; serves one thread at a time."""

    def __init__(
        self,
        elevations: NDArray[np.float64],
        azimuths: NDArray[np.float64],
        range_min_m: float,
        range_max_m: float,
    ) -> None:
        """Take the beam pattern: (M,) and (C,) [rad], azimuth clockwise, elevation upwards."""

    def add_shape(
        self,
        kinds: NDArray[np.int32],
        centres: NDArray[np.float64],
        rotations: NDArray[np.float64],
        halves: NDArray[np.float64],
    ) -> int:
        """Add the solids of a shape, (P,) (P, 3) (P, 3, 3) (P, 3); give the shape's number."""

    def add_plate(self, shape: int, down_m: float, ring: NDArray[np.float64]) -> None:
        """Add a level polygon, (M, 2), to a shape, `down_m` below its origin; seen from above."""

    def mount(self, own_shape: int, p_BS: NDArray[np.float64], R_BS: NDArray[np.float64]) -> None:
        """Put the sensor on a shape at a pose, (3,) and (3, 3)."""

    def cast(
        self,
        p_NS: NDArray[np.float64],
        R_NS: NDArray[np.float64],
        shapes: NDArray[np.int32],
        p_NO: NDArray[np.float64],
        R_NO: NDArray[np.float64],
        water_z: NDArray[np.float64],
        own: int,
        beam: NDArray[np.int32],
        distance: NDArray[np.float64],
        body: NDArray[np.int32],
    ) -> int:
        """Cast every beam at K bodies; fill the last three; give the number of echoes."""

class VesselModel:
    """The equations of motion of one kind of vessel."""

    def __init__(
        self,
        *,
        mass: NDArray[np.float64],
        mass_inverse: NDArray[np.float64],
        linear_drag: NDArray[np.float64],
        quadratic_drag: NDArray[np.float64],
        weight_n: float,
        centre_B: NDArray[np.float64],
        keel_B: NDArray[np.float64],
        hull_radius_m: float,
        lift_per_area: float,
        propellers_B: NDArray[np.float64],
        thrust: NDArray[np.float64],
        windage: NDArray[np.float64],
        wind_world_frame: bool,
    ) -> None:
        """Take (6, 6) (6, 6) (6,) (6,), (3,), (P, 3), (2, 3), (least, greatest, lag), (3,)."""

    def step(
        self,
        position_N: NDArray[np.float64],
        q_NB: NDArray[np.float64],
        velocity_B: NDArray[np.float64],
        rates_B: NDArray[np.float64],
        thrust: NDArray[np.float64],
        command: NDArray[np.float64],
        waves: NDArray[np.float64],
        growth: float,
        wind_N: NDArray[np.float64],
        current_N: NDArray[np.float64],
        time_s: float,
        dt_s: float,
        next_position_N: NDArray[np.float64],
        next_q_NB: NDArray[np.float64],
        next_velocity_B: NDArray[np.float64],
        next_rates_B: NDArray[np.float64],
        next_thrust: NDArray[np.float64],
    ) -> None:
        """Fill the last five with the state of V vessels after dt_s."""

    def acceleration(
        self,
        position_N: NDArray[np.float64],
        q_NB: NDArray[np.float64],
        velocity_B: NDArray[np.float64],
        rates_B: NDArray[np.float64],
        thrust: NDArray[np.float64],
        waves: NDArray[np.float64],
        growth: float,
        wind_N: NDArray[np.float64],
        current_N: NDArray[np.float64],
        time_s: float,
        nu_dot: NDArray[np.float64],
    ) -> None:
        """Fill the last, (V, 6), with the accelerations in the water's frame."""
