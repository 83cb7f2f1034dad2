"""`doctor --listen`: what it says where nothing comes, and of a boat that is under way."""

from twinscrew.runtime.doctor import listening as traffic
from twinscrew.runtime.doctor.checks import Verdict
from twinscrew.runtime.doctor.listening import Heard
from twinscrew.runtime.link.ardupilot.link import AutopilotSettings
from twinscrew.runtime.vessel.config import RuntimeConfig


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


def test_of_what_was_heard_only_what_is_judged_is_kept() -> None:
    clouds: list[Heard] = []
    for k in range(100):
        traffic.keep(clouds, "points", Heard(bytes(1_000_000), 0.1 * k, None))
    assert [len(message.payload) for message in clouds] == [0] * 99 + [1_000_000]
    odometry: list[Heard] = []
    for k in range(100):
        traffic.keep(odometry, "odometry", Heard(bytes(700 if k % 2 else 5_000_000), 0.1 * k, None))
    assert {len(message.payload) for message in odometry} == {700, traffic.ODOMETRY_BYTES}
