"""`twinscrew_msgs/Explanation`: what the vessel is doing and why, in words and numbers."""

from __future__ import annotations

from typing import Final

from twinscrew.runtime.messages.header import read_stamp, write_stamp
from twinscrew.runtime.messages.types import Explanation
from twinscrew.runtime.messages.wire import Reader, Writer

EXPLANATION_TYPE: Final = "twinscrew_msgs/msg/Explanation"


def encode_explanation(said: Explanation) -> bytes:
    """Write a twinscrew_msgs/Explanation."""
    writer = Writer()
    write_stamp(writer, said.stamp_ns)
    writer.values("Q", 8, said.sequence)
    writer.string(said.sentence)
    writer.values("q", 8, said.track)
    writer.values("B", 1, said.rule)
    writer.values("2d", 8, said.cpa_m, said.tcpa_s)
    return writer.payload()


def decode_explanation(payload: bytes | memoryview) -> Explanation:
    """Read a twinscrew_msgs/Explanation.

    Raises
    ------
    MessageError
        Not such a message.
    """
    reader = Reader(payload, EXPLANATION_TYPE)
    stamp_ns = read_stamp(reader)
    (sequence,) = reader.values("Q", 8)
    sentence = reader.string()
    (track,) = reader.values("q", 8)
    rule = reader.uint8()
    cpa_m, tcpa_s = reader.values("2d", 8)
    reader.end()
    return Explanation(
        stamp_ns=stamp_ns,
        sequence=sequence,
        sentence=sentence,
        track=track,
        rule=rule,
        cpa_m=cpa_m,
        tcpa_s=tcpa_s,
    )
