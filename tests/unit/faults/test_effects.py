import numpy as np

from twinscrew.hil_sim.faults.effects import (
    Corrupting,
    Delaying,
    Dropping,
    Duplicating,
    Reordering,
)
from twinscrew.hil_sim.faults.kinds import Corrupt
from twinscrew.hil_sim.faults.line import Line

MESSAGES = [bytes([k]) * 10 for k in range(200)]


def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def through(effect, messages=MESSAGES):
    return [out for message in messages for out in effect.put(message, 0.0)]


def test_a_share_is_dropped_and_the_rest_untouched() -> None:
    kept = through(Dropping(0.3, rng()))
    assert 0.6 * len(MESSAGES) < len(kept) < 0.8 * len(MESSAGES)
    assert kept == [message for message in MESSAGES if message in kept]
    assert through(Dropping(1.0, rng())) == []
    assert through(Dropping(0.0, rng())) == MESSAGES


def test_duplicates_follow_at_once() -> None:
    assert through(Duplicating(2), MESSAGES[:2]) == [MESSAGES[0]] * 3 + [MESSAGES[1]] * 3


def test_turned_bits_differ_in_no_more_than_was_said() -> None:
    payload = bytes(1000)
    (damaged,) = through(Corrupting(Corrupt(bits=20), rng()), [payload])
    turned = sum(byte.bit_count() for byte in damaged)
    assert len(damaged) == 1000
    assert 10 < turned <= 20


def test_a_message_is_cut_off() -> None:
    assert through(Corrupting(Corrupt(keep=0.5), rng()), [b"abcdef"]) == [b"abc"]


def test_a_share_is_damaged() -> None:
    damaged = through(Corrupting(Corrupt(bits=1, share=0.5), rng()))
    hit = sum(one != other for one, other in zip(MESSAGES, damaged, strict=True))
    assert 0.35 * len(MESSAGES) < hit < 0.65 * len(MESSAGES)


def test_a_delay_keeps_the_order_and_ends_with_a_burst() -> None:
    effect = Delaying(1.0)
    for k, message in enumerate(MESSAGES[:5]):
        assert effect.put(message, 0.1 * k) == []
    assert effect.due(0.99) == []
    assert effect.due(1.11) == MESSAGES[:2]
    assert effect.due(1.11) == []
    assert effect.rest() == MESSAGES[2:5]
    assert effect.rest() == []


def test_what_is_overtaken_comes_right_behind() -> None:
    assert through(Reordering(1.0, rng()), MESSAGES[:4]) == [MESSAGES[k] for k in (1, 0, 3, 2)]
    held = Reordering(1.0, rng())
    held.put(MESSAGES[0], 0.0)
    assert held.rest() == MESSAGES[:1]


def test_effects_on_a_line_follow_one_another_and_end() -> None:
    line, late, twice = Line(), Delaying(1.0), Duplicating(1)
    line.add(late)
    line.add(twice)
    assert line.put(b"a", 0.0) == []
    assert line.put(b"b", 0.5) == []
    assert line.due(1.0) == [b"a", b"a"]
    line.remove(late)
    assert line.due(1.1) == [b"b"]  # it leaves by the end of the line
    assert line.put(b"c", 1.2) == [b"c", b"c"]
    line.remove(twice)
    assert line.put(b"d", 1.3) == [b"d"]
