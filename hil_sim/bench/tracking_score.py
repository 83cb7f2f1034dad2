"""How far estimated velocities are from the truth."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from twinscrew.runtime.geometry import wrap
from twinscrew.runtime.messages.types import Float64

MATCH_M = 3.0
"""[m] An estimate farther than this from everything is of nothing."""
MOVING_MPS = 0.5
"""[m/s] Slower is no vessel, and has no course worth the name (paper, sec. III)."""
NEES_95 = 9.488
"""[-] 95 % point of chi-squared with 4 degrees of freedom."""


@dataclass(frozen=True, slots=True)
class Truth:
    """What there is around an observer."""

    p_N: Float64
    """(K, 2) [m]"""
    v_N: Float64
    """(K, 2) [m/s]"""
    is_vessel: Float64
    """(K,) 1 for vessels, 0 for buoys."""
    match_m: float = MATCH_M
    """[m] How near an estimate of something is to it."""

    def nearest(self, p_N: Float64) -> int | None:
        """Give the row of what is nearest to a place, (2,) [m]; none if nothing is near."""
        apart = np.hypot(*(self.p_N - p_N).T)
        row = int(apart.argmin())
        return row if apart[row] <= self.match_m else None


@dataclass(slots=True)
class VelocityScore:
    """Collects errors of estimates."""

    speed: list[float] = field(default_factory=list)
    course: list[float] = field(default_factory=list)
    still: list[bool] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)
    unknown: int = 0

    def add(self, truth: Truth, row: int, v_N: Float64) -> None:
        """Add the velocity [m/s] estimated for one thing."""
        if not np.isfinite(v_N).all():
            self.unknown += 1
            return
        speed, true_speed = float(np.hypot(*v_N)), float(np.hypot(*truth.v_N[row]))
        if not truth.is_vessel[row]:
            self.still.append(speed < MOVING_MPS)
        elif true_speed >= MOVING_MPS:
            self.speed.append(speed - true_speed)
            course, true_course = (float(np.arctan2(v[1], v[0])) for v in (v_N, truth.v_N[row]))
            self.course.append(wrap(course - true_course))

    def add_nees(self, truth: Truth, row: int, p_N: Float64, v_N: Float64, P: Float64) -> None:
        """Add the normalised estimation error squared of a vessel's position and velocity."""
        if truth.is_vessel[row]:
            error = np.concatenate([p_N - truth.p_N[row], v_N - truth.v_N[row]])
            self.nees.append(float(error @ np.linalg.solve(P, error)))

    def figures(self) -> dict[str, float]:
        """Give the figures; NaN where nothing was seen."""
        known = len(self.speed) + len(self.still)
        figures = {
            "vessel_reports": len(self.speed),
            "buoy_reports": len(self.still),
            "speed_rmse_mps": _rms(self.speed),
            "speed_median_mps": _median(self.speed),
            "course_rmse_deg": float(np.degrees(_rms(self.course))),
            "course_median_deg": float(np.degrees(_median(self.course))),
            "buoys_static_share": float(np.mean(self.still)) if self.still else float("nan"),
            "unknown_share": self.unknown / max(1, self.unknown + known),
        }
        if self.nees:
            figures["nees_mean"] = float(np.mean(self.nees))
            figures["nees_median"] = _median(self.nees)
            figures["nees_in_95_band"] = float(np.mean(np.array(self.nees) <= NEES_95))
        return figures


def _rms(errors: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else float("nan")


def _median(errors: list[float]) -> float:
    return float(np.median(np.abs(errors))) if errors else float("nan")
