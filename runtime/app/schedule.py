"""When the policy is asked: once a decision period, on the grid of the scans' stamps."""

from __future__ import annotations

from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND


class DecisionSchedule:
    """Tells whether a decision is due at a stamp, without drift.

    Stamps of real sensors jitter, so a decision is taken on the scan nearest to its time on the
    grid: a scan may come early by a tenth of the period. After a gap the grid starts anew.
    """

    EARLY = 0.1

    def __init__(self, period_s: float) -> None:
        self._period_ns = round(period_s * NANOSECONDS_PER_SECOND)
        self._early_ns = round(self._period_ns * self.EARLY)
        self._due_ns: int | None = None

    def restart(self) -> None:
        """Make the next stamp the start of a new grid."""
        self._due_ns = None

    def is_due(self, stamp_ns: int) -> bool:
        """Tell whether a decision is due now, and if so, count it as taken."""
        if self._due_ns is None or stamp_ns - self._due_ns > self._period_ns:
            self._due_ns = stamp_ns
        if stamp_ns < self._due_ns - self._early_ns:
            return False
        self._due_ns += self._period_ns
        return True
