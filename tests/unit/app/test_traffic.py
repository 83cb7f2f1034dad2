"""`doctor --listen`: what it says where nothing comes, and of a boat that is under way."""

from twinscrew.runtime.app import traffic
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.app.finding import Verdict
from twinscrew.runtime.link.autopilot import AutopilotSettings


def test_where_nothing_comes_every_line_fails_and_says_what_to_look_at() -> None:
    bus = RuntimeConfig().bus
    silent = RuntimeConfig(
        bus=type(bus)(connect=()), autopilot=AutopilotSettings(connection="udpin:127.0.0.1:0")
    )
    findings = traffic.listen(silent, 0.2)
    assert {f.what for f in findings} >= {"points", "odometry", "cloud and sensor", "autopilot"}
    assert all(f.verdict is not Verdict.OK and f.advice for f in findings)
    warned = {f.what for f in findings if f.verdict is Verdict.WARN}
    assert warned == {"stamps"}
