"""Where the loop meets the ground stations: orders come in here, what is told goes out."""

from __future__ import annotations

from twinscrew.runtime.app.ground import GroundReport
from twinscrew.runtime.app.station_goals import Feed, StationGoals
from twinscrew.runtime.vessel.vessel import Controller


class GroundDesk:
    """Serves ground stations through the link of one vessel."""

    def __init__(self, controller: Controller, report: GroundReport) -> None:
        self.report = report
        self._controller = controller
        self._stations = controller.link.stations
        self._goals = (
            None if self._stations is None else StationGoals(self._stations, controller.core)
        )

    def serve(self, feed: Feed, now_s: float) -> None:
        """Carry out what was ordered, and hand the link what is to be told."""
        link = self._controller.link
        if self._stations is not None and self._goals is not None:
            self._goals.carry_out(feed, self._controller.stamp_ns)
            link.tell(self._goals.progress())
            self.report.complain(self._stations.complaints())
        link.tell(self.report.due(now_s))
        for text, severity in self.report.texts():
            link.say(text, severity)
