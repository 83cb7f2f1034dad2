"""What the page's server says of others' faults: little, since anybody on this machine may err."""

from __future__ import annotations

import asyncio
import errno
import logging
import sys
from typing import Any

from aiohttp.http_exceptions import HttpProcessingError


def faults_of_ours() -> logging.Logger:
    """Give a log that keeps quiet about what is no HTTP: it is answered so, with status 400."""
    log = logging.getLogger(__name__)
    log.addFilter(_is_ours)
    return log


def _is_ours(record: logging.LogRecord) -> bool:
    return not (record.exc_info and isinstance(record.exc_info[1], HttpProcessingError))


class Complaints:
    """Tells in one line, once, that no more connections can be taken.

    asyncio tells it by a traceback for each attempt, a thousand a second. It goes on when some are
    closed.
    """

    def __init__(self) -> None:
        self._told = False

    def tell(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Tell what asyncio could not; to be set as the loop's exception handler."""
        error = context.get("exception")
        if not isinstance(error, OSError) or error.errno not in {errno.EMFILE, errno.ENFILE}:
            loop.default_exception_handler(context)
        elif not self._told:
            self._told = True
            print(f"twinscrew: warning: the view's port: {error.strerror}", file=sys.stderr)
