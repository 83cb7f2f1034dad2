"""MAVLink 2 message signing: a shared 32-byte key, and a clock that only goes forward.

https://mavlink.io/en/guide/message_signing.html: every frame carries a timestamp (10 us units
since 2015-01-01) and the first 6 bytes of SHA-256(key + frame + link id + timestamp). pymavlink
only adds 1 to it a message, so a restarted peer, whose clock is newer, would refuse us: we
set it to wall time at every frame. pymavlink also remembers a stream's timestamp before it
checks the signature, so that one forged frame could shut the true peer out: here the signature
comes first.
"""

from __future__ import annotations

import hashlib
import hmac
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.permissions import require_private

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
    digest = hashlib.sha256(state.secret_key + frame[:-_SIGNATURE_LENGTH]).digest()
    if not hmac.compare_digest(digest[:_SIGNATURE_LENGTH], bytes(frame[-_SIGNATURE_LENGTH:])):
        return None
    timestamp = int.from_bytes(frame[-12:-_SIGNATURE_LENGTH], "little")
    stream = _stream(frame, system_id, component_id)
    newest = state.stream_timestamps.get(stream, state.timestamp - NEW_STREAM_WINDOW)
    return timestamp if timestamp > newest else None


def _stream(frame: bytes | bytearray, system_id: int, component_id: int) -> tuple[int, int, int]:
    """Tell what the timestamps of a frame are compared with: link, system and component."""
    return frame[-13], system_id, component_id
