"""The process that stops thrusters when the runtime does not."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import closing

import pytest
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.drivers.processes import LOOPBACK, free_port
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.vessel.keeper import LOOK_EVERY_S, SILENT_S, Keeper


@pytest.fixture
def deck() -> Iterator[tuple[list[float], ZenohSettings]]:
    endpoint, came = f"tcp/{LOOPBACK}:{free_port()}", []
    settings = ZenohSettings(listen=(endpoint,), connect=(), node="")
    with closing(ZenohBus(settings, "wamv")) as bus:

        def take(message: object) -> None:
            assert cdr.decode_thrust(message.payload) == 0.0
            came.append(time.monotonic())

        bus.subscribe("thrust_left", take)
        yield came, ZenohSettings(connect=(endpoint,))


def test_it_is_quiet_while_the_runtime_lives_and_sends_zero_while_it_does_not(deck) -> None:
    came, settings = deck
    with closing(Keeper(settings, "wamv")) as keeper:
        wait_until(lambda: came)  # nobody has told it anything yet
        for _ in range(20):
            keeper.alive(time.monotonic())
            time.sleep(0.05)
        quiet = [t for t in came if t > time.monotonic() - 0.5]
        assert not quiet
        silent_s = time.monotonic()
        wait_until(lambda: len([t for t in came if t > silent_s]) > 10)
        first_s = next(t for t in came if t > silent_s)
        assert first_s - silent_s > 0.5 * SILENT_S
    ended_s = time.monotonic()
    wait_until(lambda: came[-1] > ended_s + 1.0)  # and after the runtime's end


def test_one_that_was_killed_is_started_again_and_what_ends_the_runtime_does_not_end_it(
    deck,
) -> None:
    came, settings = deck
    with closing(Keeper(settings, "wamv")) as keeper:
        wait_until(lambda: came)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            os.kill(keeper.pid, number)
        time.sleep(0.3)
        assert keeper.alive(time.monotonic() + LOOK_EVERY_S) is None
        first = keeper.pid
        os.kill(first, signal.SIGKILL)
        word = wait_until(lambda: keeper.alive(time.monotonic() + 2 * LOOK_EVERY_S + len(came)))
        assert word == "it had ended with status -9"
        assert keeper.pid != first
        again_s = time.monotonic()
        wait_until(lambda: came[-1] > again_s)
