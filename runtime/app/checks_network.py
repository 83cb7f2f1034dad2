"""What the doctor looks at of the connections: endpoints, devices and files a boat needs."""

from __future__ import annotations

import grp
import os
import pwd
import re
import socket
from pathlib import Path
from typing import Final, NamedTuple

from twinscrew.runtime.app.finding import Finding, fail, ok, warn
from twinscrew.runtime.vessel.config import RuntimeConfig

WAIT_S: Final = 1.0
"""[s] How long somebody may take to answer a call on a boat's own network."""
ENDPOINT: Final = re.compile(r"(tcp|tls|udp|quic)/(\[[^\]]+\]|[^:/]+):(\d+)")
"""Zenoh's locators, as tcp/10.0.0.5:7447."""


class Endpoint(NamedTuple):
    """Where somebody listens."""

    kind: str
    host: str
    port: int


def endpoint_of(locator: str) -> Endpoint | None:
    """Read a Zenoh locator; None if it is of a kind that cannot be called by hand."""
    match = ENDPOINT.match(locator)
    return None if match is None else Endpoint(match[1], match[2].strip("[]"), int(match[3]))


def check_network(config: RuntimeConfig) -> Finding:
    """Call every Zenoh endpoint that the boat is to connect to."""
    called, silent = [], []
    for locator in config.bus.connect:
        endpoint = endpoint_of(locator)
        if endpoint is None or endpoint.kind not in {"tcp", "tls"}:
            continue
        problem = _call(endpoint)
        called.append(locator)
        if problem:
            silent.append(f"{locator}: {problem}")
    if silent:
        advice = "start what should listen there (bridge, router, sensors); look at the firewall"
        return fail("network", "; ".join(silent), advice)
    if not called:
        return ok("network", "no endpoint to call")
    return ok("network", f"somebody answers at {', '.join(called)}")


def _call(endpoint: Endpoint) -> str:
    """Try to connect; give what went wrong."""
    try:
        socket.create_connection((endpoint.host, endpoint.port), WAIT_S).close()
    except OSError as error:
        return str(error.strerror or error)
    return ""


def check_permissions(config: RuntimeConfig) -> Finding:
    """Look whether this user may use the devices and read the files that are named."""
    user = _user()
    wanting = [
        f"{path}: {problem}"
        for path, mode in _needed(config)
        if (problem := _refusal(path, mode)) is not None
    ]
    if wanting:
        advice = "the serial line's group is usually dialout: usermod -a -G dialout USER"
        return fail("permissions", f"{user}: {'; '.join(wanting)}", advice)
    if os.geteuid() == 0:
        return warn("permissions", f"{user}: everything", "on a boat run it as a user of its own")
    return ok("permissions", user)


def _needed(config: RuntimeConfig) -> list[tuple[Path, int]]:
    """Give the devices and files, and what is to be done with them."""
    needed = []
    if config.bus.config_file is not None:
        needed.append((Path(config.bus.config_file), os.R_OK))
    line = config.autopilot.connection.removeprefix("serial:")
    if line.startswith("/"):
        needed.append((Path(line.partition(":")[0]), os.R_OK | os.W_OK))
    return needed


def _refusal(path: Path, mode: int) -> str | None:
    if not path.exists():
        return "is not there"
    if os.access(path, mode):
        return None
    group = grp.getgrgid(path.stat().st_gid).gr_name
    return f"may not be {'used' if mode & os.W_OK else 'read'}; it is of group {group}"


def _user() -> str:
    try:
        return pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return f"user {os.geteuid()}"
