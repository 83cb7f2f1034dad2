"""Zenoh's configuration, made from settings; nothing beyond this machine unless asked for."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import zenoh
from msgspec import Meta

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.files import read_file
from twinscrew.runtime.messages.topics import KeyFormat
from twinscrew.runtime.permissions import require_private
from twinscrew.runtime.settings import Positive, Settings

MOST_SESSIONS: Final = 32
"""[-] Programs that may be connected at a time: fewer than there are threads that receive."""
os.environ.setdefault("ZENOH_RUNTIME", "(rx: (worker_threads: 40), tx: (worker_threads: 4))")
"""Zenoh's threads, which it reads once, before the first session. While Zenoh gives up a peer that
has stopped reading (10 s after it fell silent, for 10 s), that holds one of its receiving threads,
of which there are two by default: two stopped viewers kept everybody's messages from coming in."""

DEFAULT_ENDPOINT: Final = "tcp/127.0.0.1:7447"
"""Zenoh's usual port, on this machine only."""


class ZenohSettings(Settings, frozen=True):
    """How to reach the others. Complete without a file."""

    mode: Literal["peer", "client", "router"] = "peer"
    """A peer goes on trying to reach its `connect` endpoints, and hears those who are there. A
    client needs one of them at once, and hears everybody whom that one hears: for tools."""
    connect: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    """Where to find the others: a simulator, a bridge or a router."""
    listen: tuple[str, ...] = ()
    """Where to be found; nowhere by default."""
    multicast_scouting: bool = False
    """Look for others on the local network, and let them find us."""
    shared_memory: bool = True
    """Let large payloads go to programs on this machine by shared memory."""
    config_file: str | None = None
    """A configuration in Zenoh's own words (JSON5): TLS, access control. The five settings above
    are applied over it where they are not at their defaults; what it does not say of listening and
    of looking for others is theirs, too. Private keys that it names must be their owner's alone."""
    key_format: KeyFormat = "ros2dds"
    """Whose keys: those of zenoh-bridge-ros2dds, or of rmw_zenoh."""
    domain: Annotated[int, Meta(ge=0, le=232)] = 0
    """[-] ROS_DOMAIN_ID; rmw_zenoh's keys hold it."""
    node: Annotated[str, Meta(pattern="^([A-Za-z_][A-Za-z0-9_]*)?$")] = "twinscrew"
    """The node's name in ROS 2: `ros2 topic list` shows what is published and heard; empty: it does
    not."""
    max_message_mb: Positive = 64.0
    """[MB] Larger messages are thrown away and told. A cloud of 1e6 points has 20 to 48 MB."""
    lossless: bool = False
    """Wait where the line is full instead of dropping: for lock-step, never at sea."""


_KEYS: Final = {
    "mode": "mode",
    "connect": "connect/endpoints",
    "listen": "listen/endpoints",
    "multicast_scouting": "scouting/multicast/enabled",
    "shared_memory": "transport/shared_memory/enabled",
}
"""Where in Zenoh's configuration a setting belongs."""
_SHY: Final = ("listen", "multicast_scouting")
"""Zenoh would listen at every address, and look for others, where a file does not say otherwise."""
_PRIVATE_KEYS: Final = (
    "transport/link/tls/listen_private_key",
    "transport/link/tls/connect_private_key",
)
_ROOM: Final = 2
"""[-] Zenoh itself drops a message of more than this many times the limit, before it is whole: a
peer cannot fill the memory. Up to there the message comes, and its sender's topic can be named."""
_NEVER_BLOCKS: Final = {
    # What others publish is dropped, and not waited with, where one for whom it is passed on does
    # not read: rmw_zenoh and the bridges ask to wait, and the wait (5 s) would be everybody's.
    "qos/network": [
        {
            "id": "lookers_on_never_block",
            "messages": ["put", "delete"],
            "flows": ["ingress"],
            "overwrite": {"congestion_control": "drop"},
        }
    ],
}
_OUR_DEFAULTS: Final = {
    # Look again after 0.1 s, later every second: a boat's programs start in any order.
    "connect/retry": {
        "period_init_ms": 100,
        "period_max_ms": 1000,
        "period_increase_factor": 2.0,
    },
    # Do not wait for peers when opening: matching is awaited where it matters.
    "open/return_conditions": {"connect_scouted": False, "declares": False},
}


def zenoh_config(settings: ZenohSettings) -> zenoh.Config:
    """Make Zenoh's configuration.

    Raises
    ------
    ConfigError
        The file cannot be read, or Zenoh refuses a value; the error names it.
    """
    if settings.config_file is None:
        config = zenoh.Config()
        names = set(_KEYS)
        _insert_all(config, _OUR_DEFAULTS)
    else:
        config = _read(Path(settings.config_file))
        defaults = ZenohSettings()
        names = {n for n in _KEYS if getattr(settings, n) != getattr(defaults, n)}
        names |= {n for n in _SHY if _unsaid(config, _KEYS[n])}
        _check_private_keys(config)
    protection: dict[str, Any] = {"transport/unicast/max_sessions": MOST_SESSIONS}
    if not settings.lossless:
        protection |= _NEVER_BLOCKS
    _insert_all(config, {k: v for k, v in protection.items() if _unsaid(config, k)})
    most = round(_ROOM * settings.max_message_mb * 1_000_000)
    _insert_all(config, {"transport/link/rx/max_message_size": most})
    _insert_all(config, {_KEYS[name]: getattr(settings, name) for name in sorted(names)})
    return config


def in_short(error: Exception) -> str:
    """Give Zenoh's words without the places in its source."""
    return re.sub(r" at /\S+:\d+\.?", "", str(error)).strip()


def _insert_all(config: zenoh.Config, values: dict[str, Any]) -> None:
    for key, value in values.items():
        try:
            config.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            raise ConfigError(f"{value!r}: {in_short(error)}", file="zenoh", key=key) from None


def _unsaid(config: zenoh.Config, key: str) -> bool:
    """Tell whether a key has Zenoh's own default."""
    return bool(config.get_json(key) == zenoh.Config().get_json(key))


def _check_private_keys(config: zenoh.Config) -> None:
    for key in _PRIVATE_KEYS:
        path = json.loads(config.get_json(key))
        if path is not None:
            require_private(Path(path))


def _read(path: Path) -> zenoh.Config:
    if not path.is_file():
        raise ConfigError("no such file", file=path)
    try:
        return zenoh.Config.from_json5(read_file(path).decode("utf-8"))
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error
    except (zenoh.ZError, UnicodeDecodeError) as error:
        raise ConfigError(f"not a Zenoh configuration: {in_short(error)}", file=path) from None
