"""What the estimation can be told."""

from __future__ import annotations

from twinscrew.runtime.estimation.inertial import InertialSettings
from twinscrew.runtime.estimation.sensors import SensorSettings
from twinscrew.runtime.link.datum import Datum
from twinscrew.runtime.settings import Positive, Settings


class EstimationSettings(Settings, frozen=True):
    """Odometry from GPS and IMU; only for `odometry_source = "gps_imu"`."""

    datum: Datum | None = None
    """latitude_deg and longitude_deg of the local frame's origin; none: the first fix."""
    rate_hz: Positive = 20.0
    """[Hz] How often odometry is given."""
    attitude_hz: Positive = 10.0
    """[Hz] How often the IMU's attitude is used: its errors do not change faster."""
    gps_lost_s: Positive = 0.5
    """[s] After so long without a fix that can be used the estimate is said to coast."""
    gps_disagrees_s: Positive = 2.0
    """[s] After fixes have lain outside the gate for so long the estimate starts from them anew."""
    usable_sigma_m: Positive = 2.0
    """[m] Odometry is given while the position's standard deviation is less, in any direction,"""
    usable_sigma_mps: Positive = 0.5
    """[m/s] and the velocity's: after the first fix it is not known yet."""
    imu_gap_s: Positive = 0.25
    """[s] After a longer silence of the IMU the estimate starts anew."""
    sensors: SensorSettings = SensorSettings()
    inertial: InertialSettings = InertialSettings()
