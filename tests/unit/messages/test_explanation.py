"""What the boat does and why, on the wire: our bytes against another implementation's."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.decision import EXPLANATION_TYPE
from twinscrew.runtime.messages.topics import type_store
from twinscrew.runtime.messages.types import Explanation

SAID = Explanation(
    stamp_ns=12_345_678_901,
    sequence=7,
    sentence="Giving way to track 12 (rule 15), 30\u00b0 to starboard.",
    track=12,
    rule=15,
    cpa_m=3.25,
    tcpa_s=9.5,
)


@given(
    st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=60),
    st.integers(-1, 2**62),
    st.integers(0, 255),
)
def test_what_was_said_comes_back_whatever_it_was(sentence, track, rule):
    said = Explanation(
        stamp_ns=5, sequence=3, sentence=sentence, track=track, rule=rule, cpa_m=-1.5, tcpa_s=0.0
    )
    assert cdr.decode_explanation(cdr.encode_explanation(said)) == said


def test_a_tool_that_knows_the_definition_reads_and_writes_the_same_bytes():
    payload = cdr.encode_explanation(SAID)
    message = type_store().deserialize_cdr(payload, EXPLANATION_TYPE)
    assert (message.sentence, message.track, message.rule) == (SAID.sentence, 12, 15)
    assert (message.cpa_m, message.tcpa_s, message.sequence) == (3.25, 9.5, 7)
    assert bytes(type_store().serialize_cdr(message, EXPLANATION_TYPE)) == payload


def test_nothing_near_is_no_number():
    said = cdr.decode_explanation(
        cdr.encode_explanation(Explanation(stamp_ns=1, sequence=0, sentence="Arrived."))
    )
    assert math.isnan(said.cpa_m)
    assert math.isnan(said.tcpa_s)
    assert said.track == -1


@given(st.binary(max_size=120))
def test_noise_is_never_more_than_refused(noise):
    try:
        cdr.decode_explanation(b"\x00\x01\x00\x00" + noise)
    except MessageError as error:
        assert str(error)  # noqa: PT017


@pytest.mark.parametrize("length", range(0, 60, 7))
def test_a_part_of_a_message_is_refused(length):
    with pytest.raises(MessageError):
        cdr.decode_explanation(cdr.encode_explanation(SAID)[:length])
