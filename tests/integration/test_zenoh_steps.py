"""Questions and answers over Zenoh, with real sockets on loopback."""

from collections.abc import Iterator

import pytest

from twinscrew.hil_sim.drivers.processes import free_port
from twinscrew.runtime.bus.steps import Answerer, Asker
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.errors import BusError


@pytest.fixture
def buses() -> Iterator[tuple[ZenohBus, ZenohBus]]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    leader = ZenohBus(ZenohSettings(listen=(endpoint,), connect=()), "wamv1")
    led = ZenohBus(ZenohSettings(connect=(endpoint,)), "wamv1")
    yield leader, led
    led.close()
    leader.close()


def test_a_question_that_nobody_answers_in_time_is_an_error(
    buses: tuple[ZenohBus, ZenohBus],
) -> None:
    asker = Asker(buses[0], "step", patience_s=0.2)
    assert not asker.is_answered(0.0)
    with pytest.raises(BusError, match=r"wamv1/step: no answer in 0\.2 s"):
        asker.ask(b"?")
    answerer = Answerer(buses[1], "step")
    assert asker.is_answered(60.0)
    with pytest.raises(BusError, match="no answer"):
        asker.ask(b"?")
    assert answerer.question(1.0) == b"?"


def test_an_answerer_that_nobody_asks_gives_up_and_answers_nothing_unasked(
    buses: tuple[ZenohBus, ZenohBus],
) -> None:
    answerer = Answerer(buses[1], "step")
    with pytest.raises(BusError, match=r"nobody asked for 0\.05 s"):
        answerer.question(0.05)
    with pytest.raises(BusError, match="nothing was asked"):
        answerer.answer(b"!")
