"""Where the vessel meets the ground stations: orders come in here, what is told goes out."""

from __future__ import annotations

from collections.abc import Callable

from twinscrew.runtime.app.ground import GroundReport
from twinscrew.runtime.app.station_goals import Feed, Progress, StationGoals
from twinscrew.runtime.link.ardupilot.link import AutopilotLink
from twinscrew.runtime.messages.types import Odometry


class GroundDesk:
    """Serves ground stations through the link of one vessel.

    Parameters
    ----------
    link
        Carries what stations say, and what they are told.
    report
        What they are told.
    mission
        The goals that the vessel heads for.
    odometry
        Gives the vessel's last odometry; None if there is none.
    """

    def __init__(
        self,
        link: AutopilotLink,
        report: GroundReport,
        mission: Progress,
        odometry: Callable[[], Odometry | None],
    ) -> None:
        self.report = report
        self._link = link
        self._stations = link.stations
        self._goals = (
            None if self._stations is None else StationGoals(self._stations, mission, odometry)
        )

    def serve(self, feed: Feed, stamp_ns: int, now_s: float) -> None:
        """Carry out what was ordered, and hand the link what is to be told."""
        if self._stations is not None and self._goals is not None:
            self._goals.carry_out(feed, stamp_ns)
            self._link.tell(self._goals.progress())
            self.report.complain(self._stations.complaints())
        self._link.tell(self.report.due(now_s))
        for text, severity in self.report.texts():
            self._link.say(text, severity)
