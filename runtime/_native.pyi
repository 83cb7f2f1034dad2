"""Native kernels. Frames and units as in the C++ headers of runtime/native."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

def gather_frd(
    data: NDArray[np.uint8],
    offsets: tuple[int, ...],
    shape: tuple[int, int],
    steps: tuple[int, int],
    points_S: NDArray[np.float32],
) -> None: ...

class Gates:
    range_min: float
    range_max: float
    mask_hull: bool
    hull_aft: float
    hull_fore: float
    hull_half_width: float
    drop_water: bool
    surface_down: float
    clearance: float
    weak_clearance: float
    weak: float
    def __init__(self) -> None: ...

class FootprintRule:
    def __init__(
        self, length: float, beam: float, reach: float, least: float, points: int
    ) -> None: ...

class Counts:
    """What became of the points of a scan; the counts add up to `points`."""

    def __init__(self) -> None: ...
    @property
    def points(self) -> int:
        """[-] All points of the cloud."""
    @property
    def empty(self) -> int:
        """[-] Without an echo: NaN, infinite, or at the sensor's origin."""
    @property
    def range(self) -> int:
        """[-] Nearer or farther than of use."""
    @property
    def no_beam(self) -> int:
        """[-] In a direction in which the described sensor fires no beam."""
    @property
    def hull(self) -> int:
        """[-] On the own hull."""
    @property
    def water(self) -> int:
        """[-] From the water."""
    @property
    def hidden(self) -> int:
        """[-] In one cell of the image with a nearer one."""
    @property
    def used(self) -> int:
        """[-] In the range image."""

Found = tuple[
    NDArray[np.float64],  # (K, 2) centres
    NDArray[np.float64],  # (K,) radii
    NDArray[np.int64],  # (K,) echoes
    NDArray[np.int64],  # (K,) of what cut object it is a piece, or -1
    NDArray[np.int64],  # (K + 1,) where each object's strips begin
    NDArray[np.float64],  # (S, 4) strips: x, y, length, echoes
    NDArray[np.float64],  # (3,) the sensor
    NDArray[np.float64],  # (3,) its z axis
    NDArray[np.float64],  # (A, 2) the boundary of the free water
    NDArray[np.float64],  # (A,) heights of the echoes there, NaN without
    NDArray[np.int64],  # (A,) of what cut object they are, or -1
]
"""What a kernel finds in a scan; places and directions in frame L."""

class Kernel:
    def __init__(
        self,
        *,
        elevations: Sequence[float],
        first_azimuth: float,
        azimuth_step: float,
        columns: int,
        wraps: bool,
        gates: Gates,
        theta: float,
        noise: float,
        bridged: int,
        reach: float,
        merge_across: float,
        merge_along: float,
        footprint: FootprintRule,
        least_points: int,
        full_range: float,
        far_points: int,
        longest: float,
        piece: float,
        strip_gap: float,
        sector: int,
        R_BS: Sequence[float],
        p_BS: Sequence[float],
        column_times: tuple[float, float] | None,
        wide: bool = True,
    ) -> None: ...
    def scan(
        self,
        points_S: NDArray[np.float32],
        intensity: NDArray[np.float32] | None,
        time: NDArray[np.float32] | None,
        q_NB: NDArray[np.float64],
        rates: NDArray[np.float64] | None,
        velocity: NDArray[np.float64] | None,
    ) -> tuple[Counts, Found]:
        """project, segment and objects in one call."""
    def project(
        self,
        points_S: NDArray[np.float32],
        intensity: NDArray[np.float32] | None,
        time: NDArray[np.float32] | None,
        q_NB: NDArray[np.float64],
        rates: NDArray[np.float64] | None,
        velocity: NDArray[np.float64] | None,
    ) -> Counts: ...
    def segment(self) -> int: ...
    def objects(self) -> Found: ...
    def range_image(self) -> NDArray[np.float32]: ...
    def point_image(self) -> NDArray[np.int32]: ...
    def labels(self) -> NDArray[np.int32]: ...
    def object_image(self) -> NDArray[np.int32]: ...

class Shift:
    @property
    def pairs(self) -> int: ...
    @property
    def x(self) -> float: ...
    @property
    def y(self) -> float: ...
    @property
    def xx(self) -> float: ...
    @property
    def xy(self) -> float: ...
    @property
    def yy(self) -> float: ...

class FreeWater:
    def __init__(
        self,
        *,
        boundary: NDArray[np.float64],
        heights: NDArray[np.float64],
        seen: NDArray[np.int64],
        begin: Sequence[float],
        sector: float,
        guard: float,
        is_closed: bool,
        elevations: NDArray[np.float64],
        down: Sequence[float],
        least: float,
    ) -> None: ...
    def ask(
        self, places: NDArray[np.float64], tops: NDArray[np.float64], margin: float
    ) -> tuple[NDArray[np.int8], NDArray[np.int64]]: ...

class ShiftFinder:
    def __init__(
        self,
        *,
        search: float,
        length: float,
        spacing: float,
        sigma: float,
        ends: float,
        robust: float,
        pairs: int,
    ) -> None: ...
    def __call__(
        self,
        before: NDArray[np.float64],
        after: NDArray[np.float64],
        guess: Sequence[float],
        centre: Sequence[float],
        turn: float,
    ) -> Shift: ...

class CentroidModel:
    def __init__(
        self,
        *,
        range: Sequence[float],  # noqa: A002
        depth: Sequence[float],
        small_depth: float,
        buoy: float,
        hull: float,
        along: float,
        across: float,
        row_spread: float,
        row: float,
        sigma: float,
        scatter: float,
        jump: float,
        edge: float,
        edge_sigma: float,
    ) -> None: ...
    def measured(
        self,
        p: NDArray[np.float64],
        radius: NDArray[np.float64],
        points: NDArray[np.int64],
        viewpoint: tuple[float, float, float, float],
    ) -> tuple[
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        list[int],
    ]: ...
    def bias_variance(
        self, places: NDArray[np.float64], radius: NDArray[np.float64], north: float, east: float
    ) -> NDArray[np.float64]: ...

def crowded(
    places: NDArray[np.float64], centres: NDArray[np.float64], radii: NDArray[np.float64]
) -> list[list[int]]: ...
def invert_stack(matrices: NDArray[np.float64]) -> NDArray[np.float64]: ...
def innovations(
    x: NDArray[np.float64],
    P: NDArray[np.float64],
    z: NDArray[np.float64],
    H: NDArray[np.float64],
    R: NDArray[np.float64],
    gate: NDArray[np.float64],
    most: float,
) -> NDArray[np.float64]: ...

class Law:
    def __init__(
        self,
        base: tuple[float, float],
        gain: float = 0.0,
        low: float = ...,
        high: float = ...,
    ) -> None: ...
    def after(self, first: tuple[float, float], until: float) -> Law: ...
    def __call__(self, time: float, surge: float) -> tuple[float, float]: ...

class Foresight:
    def __init__(
        self,
        *,
        vessel: tuple[Sequence[float], Sequence[float], Sequence[float]],
        lever: float,
        hull: Sequence[tuple[float, float]],
        close_hull: Sequence[tuple[float, float]],
        steps: int,
        dt: float,
        slew: float,
        margin: float,
        approach: float,
    ) -> None: ...
    def acceleration(
        self, motion: Sequence[float], thrust: tuple[float, float]
    ) -> tuple[float, float, float]: ...
    def path(
        self,
        motion: Sequence[float],
        thrust: tuple[float, float],
        law: Law,
        push: tuple[float, float],
    ) -> NDArray[np.float64]: ...
    def contact(
        self,
        path: NDArray[np.float64],
        p: NDArray[np.float64],
        v: NDArray[np.float64],
        radius: NDArray[np.float64],
        horizon: NDArray[np.float64],
        shores: NDArray[np.float64],
        clearance: float,
        margin: float,
        until: float,
    ) -> tuple[float, float, float, int, bool]: ...
    def judge(
        self,
        motion: Sequence[float],
        thrust: tuple[float, float],
        law: Law,
        push: tuple[float, float],
        p: NDArray[np.float64],
        v: NDArray[np.float64],
        radius: NDArray[np.float64],
        horizon: NDArray[np.float64],
        shores: NDArray[np.float64],
        clearance: float,
        margin: float,
        until: float,
    ) -> tuple[float, float, float, int, bool]: ...

def pair_fits(
    x: NDArray[np.float64],
    P: NDArray[np.float64],
    z: NDArray[np.float64],
    H: NDArray[np.float64],
    R: NDArray[np.float64],
    R_rad2: NDArray[np.float64],
    origin: Sequence[float],
    gate: float,
) -> NDArray[np.float64]: ...
def mixtures(
    x: NDArray[np.float64],
    P: NDArray[np.float64],
    z: NDArray[np.float64],
    H: NDArray[np.float64],
    R: NDArray[np.float64],
    R_rad2: NDArray[np.float64],
    origin: Sequence[float],
    shares: NDArray[np.float64],
) -> NDArray[np.float64]: ...
def shadowed(
    offsets: NDArray[np.float64], hides: NDArray[np.bool_], width: float
) -> NDArray[np.bool_]: ...
def association_marginals(weights: NDArray[np.float64]) -> NDArray[np.float64]: ...

class RoutePlanner:
    def __init__(
        self,
        *,
        least: float,
        wanted: float,
        nearness: float,
        finest: float,
        coarsest: float,
        drift_s: float,
        escape: float,
        most: int,
    ) -> None: ...
    def divide(
        self,
        shores: NDArray[np.float64],
        walls: NDArray[np.float64],
        low: tuple[float, float],
        side: float,
    ) -> None: ...
    @property
    def size(self) -> int:
        """[-] Cells."""
    def covers(self, place: tuple[float, float]) -> bool: ...
    def clearance(self, a: tuple[float, float], b: tuple[float, float]) -> float: ...
    def leg(self, a: tuple[float, float], b: tuple[float, float]) -> float: ...
    def find(
        self, start: tuple[float, float], goal: tuple[float, float], drift: tuple[float, float]
    ) -> tuple[int, NDArray[np.float64], float, int]:
        """Give how it ended (0: found), places, cost, cells that were looked at."""

def legs_clearance(
    legs: NDArray[np.float64], walls: NDArray[np.float64]
) -> NDArray[np.float64]: ...

class LearntMap:
    def __init__(
        self,
        *,
        cell: float,
        size: int,
        certain: int,
        most: int,
        margin: float,
        height: float,
        keep_s: float,
    ) -> None: ...
    def reset(self) -> None: ...
    def see(
        self,
        *,
        water: FreeWater | None,
        boundary: NDArray[np.float64],
        heights: NDArray[np.float64],
        seen: NDArray[np.int64],
        stands: NDArray[np.uint8],
        sensor: tuple[float, float],
        own: tuple[float, float],
        heading: float,
        time: float,
    ) -> None: ...
    @property
    def version(self) -> int: ...
    @property
    def known(self) -> int:
        """[-] Cells with some evidence of a wall."""
    def segments(self) -> NDArray[np.float64]: ...
    def free_at(self, place: tuple[float, float]) -> float: ...
    def wall_at(self, place: tuple[float, float]) -> float: ...
