import pytest

from twinscrew.runtime.link.ardupilot.commands import SELDOM_S, TRIES, Stream

SERVO_OUTPUT_RAW, ATTITUDE, HEARTBEAT = 36, 30, 0


class Sender:
    """Sends one message at a rate, and counts how often it is asked for it."""

    def __init__(self, rate_hz, message_id=SERVO_OUTPUT_RAW, wanted_hz=10.0):
        self.stream, self.id = Stream(1, message_id, wanted_hz), message_id
        self.rate_hz, self.now_s, self.next_s = rate_hz, 0.0, 0.0
        self.asked_s, self.sent = [], 0

    def send(self, seconds, *, obeys=False, keeps=lambda k: True):
        for _ in range(round(seconds / 0.01)):
            self.now_s = round(self.now_s + 0.01, 6)
            if self.rate_hz and self.now_s >= self.next_s:
                self.next_s = round(self.now_s + 1.0 / self.rate_hz, 6)
                self.sent += 1
                if keeps(self.sent):
                    self.stream.arrived(self.id, self.now_s)
            if self.stream.ask(self.now_s):
                self.asked_s.append(self.now_s)
                if obeys:
                    self.rate_hz, self.next_s = 10.0, self.now_s
        return self


@pytest.mark.parametrize("rate_hz", [0.0, 1.0, 10.0, 50.0])
def test_it_is_asked_for_at_once_whatever_comes(rate_hz):
    assert Sender(rate_hz).send(0.01).asked_s == [0.01]


def test_a_rate_that_comes_is_not_asked_for_again():
    assert len(Sender(1.0).send(60.0, obeys=True).asked_s) == 1


def test_a_rate_that_falls_is_asked_for_again_within_a_second():
    sender = Sender(1.0).send(10.0, obeys=True)
    sender.rate_hz = 1.0
    sender.send(1.0, obeys=True)
    assert len(sender.asked_s) == 2
    assert sender.rate_hz == 10.0


def test_a_rate_that_does_not_come_is_named_with_the_parameter_to_set():
    sender = Sender(1.0).send(TRIES * 1.0)
    assert sender.stream.refused(sender.now_s) == (
        "SERVO_OUTPUT_RAW comes at 1.0 Hz, 10 Hz asked for: set SRn_RC_CHAN to 10"
    )
    sender.asked_s.clear()
    sender.send(10 * SELDOM_S)
    assert 9 <= len(sender.asked_s) <= 11
    sender.send(SELDOM_S + 2.0, obeys=True)
    assert sender.stream.refused(sender.now_s) is None


def test_a_third_of_the_messages_may_be_lost():
    sender = Sender(10.0).send(60.0, keeps=lambda k: k % 3 != 0)
    assert len(sender.asked_s) == 1


def test_after_a_restart_it_is_asked_for_at_once():
    sender = Sender(10.0).send(10.0)
    sender.stream.ask_again()
    assert len(sender.send(0.01).asked_s) == 2


@pytest.mark.parametrize(("rate_hz", "shows"), [(10.0, True), (1.0, False), (0.0, False)])
def test_only_a_stream_that_comes_at_its_rate_shows_a_silence(rate_hz, shows):
    sender = Sender(rate_hz).send(3.0)
    assert sender.stream.shows_silence(0.5) is shows
    sender.rate_hz = 0.0
    assert sender.send(5.0).stream.shows_silence(0.5) is shows


def test_a_message_once_a_second_shows_no_silence_of_half_a_second():
    sender = Sender(1.0, HEARTBEAT, wanted_hz=1.0).send(20.0)
    assert not sender.stream.shows_silence(0.5)
    assert len(sender.asked_s) == 1
