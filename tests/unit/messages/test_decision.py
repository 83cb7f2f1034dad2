from dataclasses import replace

import numpy as np
import pytest

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.decision import decode_decision, encode_decision
from twinscrew.runtime.messages.types import Decision, HealthEvent, Objects, Severity, Tracks


def decision(count=2, **changes):
    rng = np.random.default_rng(5)
    fields = {
        "stamp_ns": 100,
        "sequence": 3,
        "acted": False,
        "thrust_rate": rng.normal(size=2),
        "thrust": rng.normal(size=2),
        "observation": None,
        "objects": Objects(
            stamp_ns=100,
            p_L=rng.normal(size=(count, 2)),
            radius=rng.random(count),
            points=np.arange(count),
        ),
        "tracks": Tracks(
            stamp_ns=100,
            id=np.arange(count),
            p_N=rng.normal(size=(count, 2)),
            v_N=rng.normal(size=(count, 2)),
            radius=rng.random(count),
            covariance=rng.normal(size=(count, 4, 4)),
            age_s=rng.random(count),
        ),
    }
    return Decision(**(fields | changes))


def test_a_decision_without_an_observation_comes_back_without_one():
    read = decode_decision(encode_decision(decision()))
    assert read.observation is None
    assert read.acted is False


@pytest.mark.parametrize("count", [0, 1, 7])
def test_every_array_comes_back_bit_for_bit_and_in_shape(count):
    made = decision(count)
    read = decode_decision(encode_decision(made))
    for stage in ("objects", "tracks"):
        for name in getattr(made, stage).__slots__:
            before, after = getattr(getattr(made, stage), name), getattr(getattr(read, stage), name)
            np.testing.assert_array_equal(before, after)
            assert np.shape(before) == np.shape(after)


@pytest.mark.parametrize(
    "change",
    [
        {"sequence": 4},
        {"acted": True},
        {"arrived": True},
        {"thrust": np.array((0.0, np.nextafter(0.0, 1.0)))},
        {"events": (HealthEvent(stamp_ns=1, name="a", severity=Severity.INFO),)},
    ],
    ids=lambda change: next(iter(change)),
)
def test_the_smallest_change_changes_the_bytes(change):
    base = {"thrust": np.zeros(2)}
    assert encode_decision(decision(**base)) != encode_decision(decision(**(base | change)))


def test_an_array_in_another_memory_order_gives_the_same_bytes():
    made = decision(4)
    turned = replace(made.objects, p_L=np.asfortranarray(made.objects.p_L))
    assert encode_decision(replace(made, objects=turned)) == encode_decision(made)


def test_arrays_that_disagree_in_length_are_refused():
    made = decision(2)
    wrong = replace(made, objects=replace(made.objects, radius=np.zeros(3)))
    with pytest.raises(MessageError, match="arrays of its objects differ in length"):
        decode_decision(encode_decision(wrong))


def test_a_severity_that_does_not_exist_is_refused():
    event = HealthEvent(stamp_ns=1, name="abc", severity=Severity.ERROR, detail="d")
    payload = encode_decision(decision(events=(event,)))
    forged = payload.replace(b"abc\x00\x02", b"abc\x00\x09")
    with pytest.raises(MessageError, match="9 is not a severity"):
        decode_decision(forged)
