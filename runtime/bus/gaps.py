"""Counts messages that never arrived, by the sequence numbers that senders attach.

A sample lost on its way (a full queue, a stalled receiver) leaves no other trace. The attachment
is rmw_zenoh's: int64 sequence, int64 source time [ns], 16-byte identity of the publisher with its
length before it.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Mapping
from typing import Final

ATTACHMENT: Final = struct.Struct("<qqB16s")
"""rmw_zenoh's attachment; its samples are thrown away without it."""
GID_SIZE: Final = 16
MAX_PUBLISHERS: Final = 256
"""[-] More identities than this on a topic are not followed: memory stays bounded."""

MOST_LOST: Final = 10_000
"""[-] A number farther ahead than this is no gap but another count: 17 minutes of scans."""


def attachment(sequence: int, source_ns: int, gid: bytes) -> bytes:
    """Give the attachment of a sample: its number from 1, wall clock [ns], who sends."""
    return ATTACHMENT.pack(sequence, source_ns, GID_SIZE, gid)


def source_time_ns(attached: bytes) -> int:
    """Give the sender's wall clock [ns] of an attachment; 0 if it is of another kind."""
    if len(attached) != ATTACHMENT.size:
        return 0
    _, source_ns, _, _ = ATTACHMENT.unpack(attached)
    return int(source_ns)


class SequenceGaps:
    """Follows every publisher of every topic."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, bytes], int] = {}
        self._lost: Counter[str] = Counter()

    def see(self, topic: str, attached: bytes) -> None:
        """Take note of a sample's attachment; one of another kind says nothing."""
        if len(attached) != ATTACHMENT.size:
            return
        sequence, _, _, gid = ATTACHMENT.unpack(attached)
        last = self._last.get((topic, gid))
        if last is None and len(self._last) >= MAX_PUBLISHERS:
            return
        if last is not None and last + 1 < sequence <= last + MOST_LOST:
            self._lost[topic] += sequence - last - 1
        self._last[topic, gid] = sequence

    @property
    def lost(self) -> Mapping[str, int]:
        """How many messages of each topic are known not to have arrived."""
        return dict(self._lost)
