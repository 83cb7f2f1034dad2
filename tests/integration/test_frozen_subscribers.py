"""Programs that look on and stop reading (SIGSTOP) do not starve a boat of what sensors send."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager

import pytest
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.drivers.processes import free_port
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings

pytestmark = pytest.mark.slow

VIEWERS = 4
CLOUD_B = 480_000
ODOMETRY_HZ, CLOUD_HZ = 20, 10

VIEWER = """
import sys, time, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["{sys.argv[1]}"]')
config.insert_json5("transport/link/tx/lease", sys.argv[2])  # [ms] after which it is given up
with zenoh.open(config) as session:
    heard = [session.declare_subscriber("**", lambda sample: None)]
    print("looking", flush=True)
    time.sleep(1000)
"""
SENSORS = """
import sys, time
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.bus.zenoh import ZenohSettings
settings = ZenohSettings(
    mode="client",
    connect=(sys.argv[1],),
    lossless=sys.argv[2] == "block",
    shared_memory=False,
)
bus = ZenohBus(settings, "wamv")
cloud, odometry = bytes(int(sys.argv[3])), bytes(700)
begin_s, ticks = time.monotonic(), 0
while True:
    bus.publish("odometry", odometry)
    if ticks % 2 == 0:
        bus.publish("points", cloud)
    ticks += 1
    time.sleep(max(0.0, begin_s + 0.05 * ticks - time.monotonic()))
"""


@contextmanager
def program(source: str, *words: object) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(source), *map(str, words)],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(
    ("congestion", "lease_ms", "wait_s"),
    [
        pytest.param("drop", 1000, 2.0, id="given up: nothing came for 10 s"),
        pytest.param("block", 10_000, 3.0, id="waited for: nothing came for 5 s, again and again"),
    ],
)
def test_stopped_viewers_do_not_keep_the_sensors_messages_from_a_boat(
    congestion: str, lease_ms: int, wait_s: float
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    # as over a network: messages in shared memory do not fill a line
    settings = ZenohSettings(listen=(endpoint,), connect=(), shared_memory=False)
    came = {"points": 0, "odometry": 0}

    def note(topic: str) -> None:
        came[topic] += 1

    with (
        closing(ZenohBus(settings, "wamv")) as boat,
        program(SENSORS, endpoint, congestion, CLOUD_B),
        ExitStack() as stack,
    ):
        for topic in came:
            boat.subscribe(topic, lambda message: note(message.topic))
        viewers = [stack.enter_context(program(VIEWER, endpoint, lease_ms)) for _ in range(VIEWERS)]
        for viewer in viewers:
            assert viewer.stdout is not None
            assert viewer.stdout.readline() == "looking\n"
        wait_until(lambda: came["points"] > 5)
        for viewer in viewers:
            os.kill(viewer.pid, signal.SIGSTOP)
        time.sleep(wait_s)  # their lines fill, or they are given up
        came.update(points=0, odometry=0)
        time.sleep(5.0)
        # half of what was sent, on a machine that has other things to do
        assert came["odometry"] > 5 * ODOMETRY_HZ / 2
        assert came["points"] > 5 * CLOUD_HZ / 2
