"""The view is for one machine alone: its port, and whom it answers."""

from __future__ import annotations

import errno
import re
import socket
from collections.abc import Awaitable, Callable
from typing import Final

from aiohttp import web

from twinscrew.runtime.errors import ConfigError

HOST: Final = "127.0.0.1"
LOCAL: Final = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d+)?")
"""What a browser on this machine calls it; it leaves the port out if it is 80."""
HEADERS: Final = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-cache",
}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@web.middleware
async def only_from_here(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Refuse what a foreign page might send from this machine's browser, and name no CDN."""
    host = request.headers.get("Host", "")  # without one, aiohttp's own would ask the DNS
    origin = request.headers.get("Origin")
    if not LOCAL.fullmatch(host) or (origin and origin.partition("://")[2] != host):
        raise web.HTTPForbidden(text="twinscrew's view answers its own page on this machine only")
    response = await handler(request)
    if not response.prepared:
        response.headers.update(HEADERS)
    return response


def listen(port: int) -> socket.socket:
    """Take a port of this machine; 0 takes any.

    Raises
    ------
    ConfigError
        Somebody else has it.
    """
    taken = socket.socket()
    taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        taken.bind((HOST, port))
        taken.listen()
    except OSError as error:
        taken.close()
        if error.errno not in {errno.EADDRINUSE, errno.EACCES}:
            raise
        why = "is in use" if error.errno == errno.EADDRINUSE else "is not ours to use"
        raise ConfigError(f"port {port} {why}; choose another", key="--port") from error
    return taken
