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
