"""`twinscrew run` and a sender that sends rubbish: it is refused by name, and the boat goes on."""

import signal
from pathlib import Path

from tests.harness.boat import cloud, odometry
from tests.harness.commands import start
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.drivers.realtime import free_port
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.bus.zenoh_config import ZenohSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import HealthEvent

RUBBISH = (b"", b"\x00", bytes(64), b"\xff" * 5000, cdr.encode_point_cloud(cloud(0.0))[:-3])


def test_malformed_and_oversized_messages_are_refused_by_name_and_good_ones_still_used(
    tmp_path: Path,
) -> None:
    endpoint, log = f"tcp/127.0.0.1:{free_port()}", tmp_path / "log.txt"
    config = tmp_path / "boat.toml"
    config.write_text(
        f'[autopilot]\nconnection = "udpin:127.0.0.1:0"\n'
        f'[bus]\nconnect = ["{endpoint}"]\nmax_message_mb = 0.02\n'
    )
    bus = ZenohBus(ZenohSettings(listen=(endpoint,), connect=(), shared_memory=False), "wamv")
    events: list[HealthEvent] = []
    decisions: list[bytes] = []
    bus.subscribe("diagnostics", lambda m: events.extend(cdr.decode_diagnostics(m.payload)))
    bus.subscribe("decision", lambda m: decisions.append(m.payload))
    runtime = start("run", "--config", config, log=log)
    try:
        wait_until(lambda: bus.wait_for_subscribers(("points", "odometry", "goal"), 0.1))

        def told(name: str, words: str) -> bool:
            return any(event.name == name and words in event.detail for event in events)

        for topic in ("points", "odometry", "goal"):
            for payload in RUBBISH:
                bus.publish(topic, payload)
            wait_until(lambda topic=topic: told("bad_message", f"{topic}: "))
        for size in (30_000, 300_000):  # above the limit; above what Zenoh puts together
            bus.publish("points", bytes(size))
        bus.publish("points", b"")
        wait_until(lambda: told("messages_missing", "1 points too large"))
        ticks = iter(range(10_000))

        def another_decision() -> bool:
            time_s = next(ticks) * 0.05
            bus.publish("odometry", cdr.encode_odometry(odometry(time_s)))
            bus.publish("points", cdr.encode_point_cloud(cloud(time_s)))
            return len(decisions) >= 3

        wait_until(another_decision)
        assert runtime.poll() is None
        runtime.send_signal(signal.SIGTERM)
        assert runtime.wait(200) == 0
    finally:
        runtime.kill()
        runtime.wait()
        bus.close()
    assert "Traceback" not in log.read_text()
