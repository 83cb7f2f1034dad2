"""Where odometry comes from if not from the bus: the autopilot, or GPS and IMU.

Either way it is encoded as the `odometry` topic, recorded, and fed to the core like a message from
the bus, so that a replay needs neither clock nor filter.

The core puts scans and odometry in order by their stamps, so both must be of one clock. GPS and IMU
are stamped by the LiDAR's, or one that is synchronised with it. The autopilot's state comes with
the loop's monotonic time (`runtime/link/boot_clock.py`); scans come with the stamps of the LiDAR's
driver. Two rules, one of which is configured:

- `arrival`: stamp and arrival of every scan give the clocks' difference, latency included. The
  median of the last ten seconds counts: a late or wrongly stamped scan moves nothing, and drift is
  followed. The latency that is known (`lidar_latency_s`) is taken out.
- `system`: stamps are this machine's wall clock (a LiDAR synchronised by PTP or NTP, or stamped by
  a driver on board), whose difference to the monotonic clock is known exactly.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from statistics import median_low
from typing import Literal, Protocol

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.estimation.estimator import EstimationSettings, Estimator
from twinscrew.runtime.link.ardupilot.link import AutopilotLink
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, HealthEvent
from twinscrew.runtime.settings import NonNegative, Settings

WINDOW = 101
"""[-] Scans whose arrivals count: ten seconds of a 10 Hz LiDAR."""
ANOTHER_CLOCK_NS = NANOSECONDS_PER_SECOND
"""[ns] A difference off by more than this is no delay: somebody set a clock."""


class AlignmentSettings(Settings, frozen=True):
    """How the autopilot's time becomes the LiDAR's; only for `odometry_source = "autopilot"`."""

    lidar_clock: Literal["arrival", "system"] = "arrival"
    """What the scans' stamps are: of a clock known only by when scans arrive, or of this
    machine's wall clock."""
    lidar_latency_s: NonNegative = 0.0
    """[s] Usual time from a scan's stamp to its arrival, taken out of `arrival`'s difference."""


class Alignment:
    """The LiDAR's clock less the loop's."""

    def __init__(
        self, settings: AlignmentSettings | None = None, wall_ns: Callable[[], int] = time.time_ns
    ) -> None:
        self._settings = settings or AlignmentSettings()
        self._wall_ns = wall_ns
        self._seen_ns: deque[int] = deque(maxlen=WINDOW)
        self.difference_ns: int | None = None
        """[ns] None before the first scan."""

    def scan_came(self, stamp_ns: int, now_s: float) -> None:
        """Take a scan's stamp, and the loop's time when it came."""
        now_ns = round(now_s * NANOSECONDS_PER_SECOND)
        if self._settings.lidar_clock == "system":
            self.difference_ns = self._wall_ns() - now_ns
            return
        latency_ns = round(self._settings.lidar_latency_s * NANOSECONDS_PER_SECOND)
        seen_ns = stamp_ns + latency_ns - now_ns
        known_ns = self.difference_ns
        if known_ns is not None and abs(seen_ns - known_ns) > ANOTHER_CLOCK_NS:
            self._seen_ns.clear()
        self._seen_ns.append(seen_ns)
        self.difference_ns = median_low(self._seen_ns)

    def lidar_ns(self, loop_ns: int) -> int | None:
        """Give the LiDAR's time of a time of the loop; None before the first scan."""
        return None if self.difference_ns is None else loop_ns + self.difference_ns


class OdometrySource(Protocol):
    """Makes odometry of what comes in."""

    def scan_came(self, stamp_ns: int, now_s: float) -> None:
        """Take a scan's stamp, and the loop's time when it came."""

    def sense(self, topic: str, payload: bytes) -> tuple[HealthEvent, ...]:
        """Take a message of one of `SENSED`; give what an operator should know.

        Raises
        ------
        MessageError
            It is not the message that it should be.
        """

    def restart(self) -> None:
        """Forget what was sensed, after a fault."""

    def payloads(self) -> list[bytes]:
        """Give the messages of the `odometry` topic that were made since the last call."""

    def take_troubles(self) -> list[str]:
        """Say why odometry could not be written since the last call, if it could not."""


SENSED = ("gps", "imu")
"""The topics that odometry is made of."""


class AutopilotOdometry:
    """What the autopilot tells of its state, as messages of the `odometry` topic."""

    def __init__(self, link: AutopilotLink, alignment: Alignment) -> None:
        self._link = link
        self._troubles: list[str] = []
        self.alignment = alignment

    def scan_came(self, stamp_ns: int, now_s: float) -> None:
        """See `OdometrySource`."""
        self.alignment.scan_came(stamp_ns, now_s)

    def sense(self, topic: str, payload: bytes) -> tuple[HealthEvent, ...]:  # noqa: ARG002
        """See `OdometrySource`: the autopilot needs no help."""
        return ()

    def restart(self) -> None:
        """See `OdometrySource`: nothing was sensed."""

    def payloads(self) -> list[bytes]:
        """Give what has come since the last call; nothing before the first scan.

        Odometry whose stamp ROS 2 cannot write is left out: the scans' clock is set to before 1901
        or after 2038.
        """
        messages = []
        for odometry in self._link.take_odometry():
            stamp_ns = self.alignment.lidar_ns(odometry.stamp_ns)
            if stamp_ns is None:
                continue
            try:
                messages.append(cdr.encode_odometry(replace(odometry, stamp_ns=stamp_ns)))
            except MessageError as error:
                self._troubles.append(str(error))
        return messages

    def take_troubles(self) -> list[str]:
        """See `OdometrySource`."""
        troubles, self._troubles = self._troubles, []
        return troubles


class GpsImuOdometry:
    """What a filter makes of GPS and IMU, as messages of the `odometry` topic."""

    def __init__(self, settings: EstimationSettings) -> None:
        self._estimator = Estimator(settings)
        self._made: list[bytes] = []

    def scan_came(self, stamp_ns: int, now_s: float) -> None:
        """See `OdometrySource`: all sensors' clocks are the same."""

    def sense(self, topic: str, payload: bytes) -> tuple[HealthEvent, ...]:
        """See `OdometrySource`."""
        if topic == "gps":
            self._estimator.fix(cdr.decode_fix(payload))
        else:
            odometry = self._estimator.imu(cdr.decode_imu(payload))
            if odometry is not None:
                self._made.append(cdr.encode_odometry(odometry))
        return self._estimator.take_events()

    def restart(self) -> None:
        """See `OdometrySource`."""
        self._estimator.restart()

    def payloads(self) -> list[bytes]:
        """See `OdometrySource`."""
        made, self._made = self._made, []
        return made

    def take_troubles(self) -> list[str]:
        """See `OdometrySource`: what cannot be written is raised by `sense`."""
        return []
