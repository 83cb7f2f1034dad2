"""MAVLink framing: bytes to messages and back, signed if there is a key."""

from __future__ import annotations

import hashlib
import hmac
import struct
import time
from collections import Counter
from collections.abc import Callable
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.files import require_private

# -- MAVLink 2 message signing: a shared 32-byte key, and a clock that only goes forward.
#
# https://mavlink.io/en/guide/message_signing.html: every frame carries a timestamp (10 us units
# since 2015-01-01) and the first 6 bytes of SHA-256(key + frame + link id + timestamp). pymavlink
# only adds 1 to it a message, so a restarted peer, whose clock is newer, would refuse us: we
# set it to wall time at every frame. pymavlink also remembers a stream's timestamp before it
# checks the signature, so that one forged frame could shut the true peer out: here the signature
# comes first.


KEY_LENGTH = 32
"""[bytes] MAVLink's key length."""
EPOCH_S = 1_420_070_400
"""[s] 2015-01-01T00:00:00Z after 1970: where signing timestamps start."""
TICKS_PER_S = 100_000
"""[1/s] Signing timestamps count 10 us."""
NEW_STREAM_WINDOW = 60 * TICKS_PER_S
"""[10 us] A peer heard for the first time may be this far behind our clock (MAVLink guide)."""
_SIGNATURE_LENGTH = 6


class Signing:
    """The key, our link's number, and the clock that stamps what we sign.

    Parameters
    ----------
    key
        32 secret bytes, the same at both ends.
    link_id
        Number of this link, 0 to 255; streams are told apart by (link, system, component).
    wall_clock
        Gives seconds since 1970; signing is the one place where the link needs the date.
    """

    def __init__(
        self, key: bytes, *, link_id: int = 0, wall_clock: Callable[[], float] = time.time
    ) -> None:
        if len(key) != KEY_LENGTH:
            raise ConfigError(f"a signing key has {KEY_LENGTH} bytes, this one {len(key)}")
        self.key = key
        self.link_id = link_id
        self._wall_clock = wall_clock

    def now(self) -> int:
        """Give wall time as a signing timestamp [10 us since 2015]."""
        return max(0, int((self._wall_clock() - EPOCH_S) * TICKS_PER_S))

    def advance(self, codec: Any) -> None:
        """Bump a codec's clock to wall time; it never goes back."""
        codec.signing.timestamp = max(codec.signing.timestamp, self.now())


def read_key(path: Path) -> bytes:
    """Read a signing key: 32 raw bytes, or 64 hexadecimal digits.

    Raises
    ------
    ConfigError
        The file cannot be read, others than its owner can, or it does not hold a key.
    """
    require_private(path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error
    if len(content) == KEY_LENGTH:
        return content
    try:
        key = bytes.fromhex(content.decode("ascii"))
    except ValueError as error:
        raise ConfigError("neither 32 bytes nor 64 hexadecimal digits", file=path) from error
    if len(key) != KEY_LENGTH:
        raise ConfigError(f"holds {len(key)} bytes, a key has {KEY_LENGTH}", file=path)
    return key


def signed_codec(system_id: int, component_id: int, signing: Signing) -> Any:
    """Make a pymavlink codec that signs what it packs and refuses what is not signed."""
    codec = mavlink.MAVLink(None, system_id, component_id)
    codec.signing.secret_key = signing.key
    codec.signing.link_id = signing.link_id
    codec.signing.sign_outgoing = True
    codec.signing.timestamp = signing.now()
    codec.check_signature = partial(is_authentic, codec.signing)
    return codec


def is_authentic(state: Any, frame: bytearray, system_id: int, component_id: int) -> bool:
    """Tell whether a signed frame is authentic, and newer than all before it on its stream.

    `state` is pymavlink's `MAVLinkSigning`; only an authentic frame changes it.
    """
    timestamp = authentic_time(state, frame, system_id, component_id)
    if timestamp is None:
        return False
    state.stream_timestamps[_stream(frame, system_id, component_id)] = timestamp
    state.timestamp = max(state.timestamp, timestamp)
    return True


def authentic_time(
    state: Any, frame: bytes | bytearray, system_id: int, component_id: int
) -> int | None:
    """Give the timestamp of a frame that `is_authentic` would accept, or None; nothing changes."""
    if not is_signed_with(state.secret_key, frame):
        return None
    timestamp = int.from_bytes(frame[-12:-_SIGNATURE_LENGTH], "little")
    stream = _stream(frame, system_id, component_id)
    newest = state.stream_timestamps.get(stream, state.timestamp - NEW_STREAM_WINDOW)
    return timestamp if timestamp > newest else None


def is_signed_with(key: bytes, frame: bytes | bytearray) -> bool:
    """Tell whether a signed frame bears the signature of a key, whatever its time."""
    digest = hashlib.sha256(key + frame[:-_SIGNATURE_LENGTH]).digest()
    return hmac.compare_digest(digest[:_SIGNATURE_LENGTH], bytes(frame[-_SIGNATURE_LENGTH:]))


def _stream(frame: bytes | bytearray, system_id: int, component_id: int) -> tuple[int, int, int]:
    """Tell what the timestamps of a frame are compared with: link, system and component."""
    return frame[-13], system_id, component_id


# -- MAVLink 2 (and no older one) on the wire: bytes to messages and back, without any socket.
#
# The dialect module does the encoding; the framing is ours, because a false start byte must not
# swallow the good frames behind it, and because a peer without the key must not be able to move a
# stream's signing clock (see `signing`). pymavlink.mavutil is not needed, and costs start-up time.

Message: TypeAlias = Any
"""A message of the dialect: `mavlink.MAVLink_*_message` (pymavlink carries no stub files)."""

_START = bytes([mavlink.PROTOCOL_MARKER_V2])
_OLD_START = bytes([mavlink.PROTOCOL_MARKER_V1])
_CRC_LENGTH = 2
MOST_FALSE_STARTS = 1000
"""[-] Beginnings a call that turn out to be none: each costs some 4 us. Noise has one in 256 bytes,
and the fastest serial line brings 5 kB between two ticks."""
MOST_LOOKED_AT = 20
"""[-] Beginnings in a datagram of a stranger's: a sender of MAVLink begins it with a frame."""
MOST_MESSAGES = 1000
"""[-] Messages a call: each costs some 6 us, and as much again to answer. The fastest serial line
brings 400 between two ticks."""


class Refusal(Enum):
    """Why a whole frame was refused, where frames must be signed."""

    UNSIGNED = "not signed with our key, or any"
    OTHER_KEY = "signed with another key"
    OLD = "signed with our key, but with a time that lies back: set both clocks"


class Wire:
    """One end of a MAVLink connection.

    Parameters
    ----------
    system_id, component_id
        Who we say we are.
    signing
        Sign what goes out and refuse what is not signed with the same key; None to do neither.
    """

    def __init__(self, system_id: int, component_id: int, signing: Signing | None = None) -> None:
        self.bad_frames = 0
        """[-] Frames refused so far: damaged, or not signed as they should be."""
        self.old_frames = 0
        """[-] How often what came began as a MAVLink 1 frame, which is not read."""
        self.refused: Counter[Refusal] = Counter()
        """How often whole frames of our vehicle's autopilot were refused, and why."""
        self.hears_signed = False
        """Whether it signs what it sends."""
        self._signing = signing
        self._codec = (
            mavlink.MAVLink(None, system_id, component_id)
            if signing is None
            else signed_codec(system_id, component_id, signing)
        )
        self._buffer = bytearray()

    @property
    def signs(self) -> bool:
        """Whether frames are signed, and unsigned ones refused."""
        return self._signing is not None

    @property
    def system_id(self) -> int:
        """[-] The system we speak as."""
        return int(self._codec.srcSystem)

    def encode(self, message: Message) -> bytes:
        """Give the frame of a message, numbered and, if asked for, signed."""
        if self._signing is not None:
            self._signing.advance(self._codec)
        frame: bytes = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        return frame

    def decode(self, data: bytes) -> list[Message]:
        """Give the messages that `data` completes; damaged and unknown ones are left out.

        The work is bounded: what follows `MOST_MESSAGES` messages or `MOST_FALSE_STARTS` beginnings
        of none is thrown away, as a radio would lose it.
        """
        if self._signing is not None:
            self._signing.advance(self._codec)
        self.old_frames += data[:1] == _OLD_START
        buffer = self._buffer
        buffer += data
        messages: list[Message] = []
        start = false_starts = 0
        while (start := buffer.find(_START, start)) >= 0:
            if false_starts >= MOST_FALSE_STARTS or len(messages) >= MOST_MESSAGES:
                self.bad_frames += 1
                break
            length = _frame_length(buffer, start)
            if length is None or start + length > len(buffer):
                whole = self._whole_frame_after(start)
                if whole is None:
                    del buffer[:start]
                    return messages
                start = whole  # turned bits gave a length that would have held all of this up
                continue
            message = self._decode_frame(buffer[start : start + length]) if length else None
            if message is None:
                start += 1  # a false start, a damaged or unknown frame: a good one may lie inside
                false_starts += 1
                continue
            start += length
            messages.append(message)
        buffer.clear()
        return messages

    def recognises(self, datagram: bytes) -> bool:
        """Tell whether a datagram carries a frame of our vehicle's autopilot; nothing is taken in.

        The frame has its checksum; with signing it is signed with our key, and newer than all that
        was heard on its stream.
        """
        start = -1
        for _ in range(MOST_LOOKED_AT):
            start = datagram.find(_START, start + 1)
            if start < 0:
                return False
            length = _frame_length(datagram, start)
            if length and self._is_the_autopilots(datagram[start : start + length], length):
                return True
        return False

    def _is_the_autopilots(self, frame: bytes, length: int) -> bool:
        sender = (self.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        if len(frame) < length or tuple(frame[5:7]) != sender or not _is_intact(frame, 0):
            return False
        if self._signing is None:
            return True
        self._signing.advance(self._codec)
        signed = bool(frame[2] & mavlink.MAVLINK_IFLAG_SIGNED)
        if signed and authentic_time(self._codec.signing, frame, *sender) is not None:
            return True
        self._note_refusal(frame)
        return False

    def _whole_frame_after(self, start: int) -> int | None:
        """Give where the next frame lies that is complete and has its checksum, if one does."""
        buffer = self._buffer
        while (start := buffer.find(_START, start + 1)) >= 0:
            length = _frame_length(buffer, start)
            if length and start + length <= len(buffer) and _is_intact(buffer, start):
                return start
        return None

    def _decode_frame(self, frame: bytearray) -> Message | None:
        try:
            message = self._codec.decode(frame)
        except (mavlink.MAVError, struct.error, ValueError):
            self.bad_frames += 1
            self._note_refusal(frame)
            return None
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_UNKNOWN:
            return None  # it was not checked: it has no name to check it by
        signed = frame[2] & mavlink.MAVLINK_IFLAG_SIGNED
        if signed and message.get_srcSystem() == self.system_id:
            self.hears_signed = True
        return message

    def _note_refusal(self, frame: bytes | bytearray) -> None:
        sender = (self.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        if self._signing is None or tuple(frame[5:7]) != sender or not _is_intact(frame, 0):
            return
        if not frame[2] & mavlink.MAVLINK_IFLAG_SIGNED:
            self.refused[Refusal.UNSIGNED] += 1
            return
        ours = is_signed_with(self._signing.key, frame)
        self.refused[Refusal.OLD if ours else Refusal.OTHER_KEY] += 1


def _frame_length(buffer: bytes | bytearray, start: int) -> int | None:
    """Give the whole frame's length [bytes], 0 if it cannot be one, None if that cannot be told."""
    if len(buffer) - start < 3:
        return None
    payload, flags = buffer[start + 1], buffer[start + 2]
    if flags & ~mavlink.MAVLINK_IFLAG_SIGNED:
        return 0
    signature = mavlink.MAVLINK_SIGNATURE_BLOCK_LEN if flags else 0
    return int(mavlink.HEADER_LEN_V2) + payload + _CRC_LENGTH + signature


def _is_intact(buffer: bytes | bytearray, start: int) -> bool:
    """Tell whether a frame of a known kind has its checksum; this decodes and counts nothing."""
    number = int.from_bytes(buffer[start + 7 : start + 10], "little")
    kind = mavlink.mavlink_map.get(number)
    if kind is None:
        return False
    end = start + mavlink.HEADER_LEN_V2 + buffer[start + 1]
    found = int.from_bytes(buffer[end : end + _CRC_LENGTH], "little")
    checksum = mavlink.x25crc(buffer[start + 1 : end])
    checksum.accumulate(bytes([kind.crc_extra]))
    return bool(checksum.crc == found)
