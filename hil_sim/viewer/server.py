"""Serves the page and its frames on this machine only.

Each page is sent one frame at a time: the next is made when the last is gone, at most ten a second.
A slow page therefore sees fewer frames, and nothing queues up. A run that ends goes over into its
replay: the source is replaced under the pages, which are greeted again.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import math
import re
import socket
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any, Final

import msgspec
from aiohttp import WSCloseCode, WSMsgType, web
from aiohttp.http_exceptions import HttpProcessingError

from twinscrew.hil_sim.viewer.sources import LiveSource, RecordedSource, Source
from twinscrew.hil_sim.viewer.wire import (
    SERIES,
    VERSION,
    Request,
    decode_request,
    encode_frame,
    encode_words,
)
from twinscrew.runtime.errors import BusError, ConfigError, TwinscrewError
from twinscrew.runtime.policy.colregs import ColregsSettings
from twinscrew.runtime.safety.explain import OWN_RADIUS_M
from twinscrew.runtime.vessel.config import RuntimeConfig

HOST: Final = "127.0.0.1"
LOCAL: Final = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d+)?")
"""What a browser on this machine calls it; it leaves the port out if it is 80."""
HEADERS: Final = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-cache",
}
PAGE: Final = Path(__file__).parent / "page"
FILES: Final = frozenset(path.name for path in PAGE.iterdir())
"""All that is served."""
PERIOD_S: Final = 0.1
"""[s] Between two frames: 10 Hz, the LiDAR's rate."""
HEARTBEAT_S: Final = 5.0
"""[s] A page that does not answer for this long is let go."""
LONGEST_REQUEST: Final = 1024
"""[B] What a page asks for is shorter."""
SPEEDS: Final = (0.25, 16.0)
"""[-] How slow and how fast a recording may be played."""
LIMITS: Final = {"cpa_m": 1.0, "tcpa_s": 6.0}
"""[m, s] A page's alarm limits until its operator sets others: the boats are 5 m long and do
3 m/s, and the assurance looks 4 s ahead."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


def greeting(source: Source, again: str = "") -> dict[str, Any]:
    """Give what a page is told once: the page itself knows no number about boats.

    Parameters
    ----------
    again
        The command that starts this view again, shown when the connection is lost.
    """
    defaults, plain = RuntimeConfig(), msgspec.to_builtins
    return {
        "version": VERSION,
        "mode": source.mode,
        "names": list(source.names),
        "duration_s": round(source.duration_s, 2),
        "begin_s": round(source.begin_s, 3),
        "scene": plain(source.scene),
        "trails": source.trails(),
        "charts": plain(source.charts()),
        "series": {"columns": SERIES, "rows": source.series()},
        "events": plain(source.events()),
        "result": plain(source.result),
        "datum": plain(source.datum),
        "hull": plain(defaults.perception.hull),
        "own_radius_m": OWN_RADIUS_M,
        "thrust": plain(defaults.thrust),
        "goal_radius_m": source.scene.goal_radius_m or defaults.mission.goal_radius_m,
        "zones": plain(ColregsSettings()),
        "limits": LIMITS,
        "orders": source.takes_orders,
        "again": again,
    }


class Player:
    """One page's place in time. Pausing is the page's own: others see on."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._playing = True
        self._speed = 1.0
        self._time_s = 0.0
        self._last_s: float | None = None
        self._due = True

    def goes_over(self, source: Source) -> None:
        """Look at the recording of what was live until now, at its end."""
        self._source, self._due, self._playing = source, True, False
        self._time_s = source.duration_s

    def ask(self, request: Request) -> None:
        """Do what the page asks for; the next frame follows it even in a pause."""
        if request.playing is not None:
            self._playing = request.playing
            if self._playing and self._time_s >= self._source.duration_s:
                self._time_s = 0.0
        if request.speed is not None and math.isfinite(request.speed):
            self._speed = min(max(request.speed, SPEEDS[0]), SPEEDS[1])
        if request.seek_s is not None and math.isfinite(request.seek_s):
            self._time_s = min(max(request.seek_s, 0.0), self._source.duration_s)
        self._due = True

    def frame(self, clock_s: float) -> bytes | None:
        """Give the frame for a moment of a steady clock [s]; None if nothing has changed."""
        elapsed_s = 0.0 if self._last_s is None else clock_s - self._last_s
        self._last_s = clock_s
        if not self._playing and not self._due:
            return None
        self._due = False
        if self._source.mode == "live":
            time_s = self._source.now_s()
        else:
            time_s = self._wind(elapsed_s)
        return encode_frame(time_s, self._source.parts(time_s), playing=self._playing)

    def _wind(self, elapsed_s: float) -> float:
        if self._playing:
            self._time_s += self._speed * elapsed_s
        if self._time_s >= self._source.duration_s:
            self._time_s, self._playing = self._source.duration_s, False
        return self._time_s


class Server:
    """Pages, each with its player, over one source."""

    def __init__(self, source: Source, again: str = "") -> None:
        self.source = source
        """What is shown now; a run that ends is followed by its replay."""
        self._again = again
        self._pages: dict[web.WebSocketResponse, Player] = {}

    def app(self) -> web.Application:
        """Give the application to serve."""
        app = web.Application(middlewares=[only_from_here])
        app.add_routes(
            [
                web.get("/", self._index),
                web.get("/frames", self._frames),
                web.get("/{name}", self._file),
            ]
        )
        app.cleanup_ctx.append(self._keep_following)
        app.on_shutdown.append(self._say_goodbye)
        return app

    async def _index(self, _: web.Request) -> web.FileResponse:
        return web.FileResponse(PAGE / "index.html")

    async def _file(self, request: web.Request) -> web.FileResponse:
        name = request.match_info["name"]
        if name not in FILES:
            raise web.HTTPNotFound
        return web.FileResponse(PAGE / name)

    async def _frames(self, request: web.Request) -> web.WebSocketResponse:
        page = web.WebSocketResponse(
            heartbeat=HEARTBEAT_S, compress=False, max_msg_size=LONGEST_REQUEST
        )
        try:
            await page.prepare(request)
        except ValueError as error:  # a key that is no ASCII
            raise web.HTTPBadRequest(text="not a WebSocket's handshake") from error
        await self._greet(page)
        player = self._pages[page] = Player(self.source)
        sender = asyncio.create_task(self._send(page, player))
        try:
            async for message in page:
                asked = decode_request(message.data) if message.type is WSMsgType.TEXT else None
                if asked is None:
                    await page.close(code=1003, message=b"not a request")
                    break
                if asked.order is not None:
                    await page.send_str(encode_words({"answer": self._order(asked)}))
                    continue
                if asked.playing and self.source.mode == "live":
                    await self._greet(page)  # with the trails of what it paused over
                player.ask(asked)
        finally:
            self._pages.pop(page, None)
            sender.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await sender
        return page

    def _order(self, request: Request) -> str:
        if request.order is None:
            return ""
        try:
            return self.source.order(request.order)
        except BusError as error:
            return f"refused: {error}"

    async def _greet(self, page: web.WebSocketResponse) -> None:
        await page.send_str(encode_words(greeting(self.source, self._again)))

    async def _send(self, page: web.WebSocketResponse, player: Player) -> None:
        clock = asyncio.get_running_loop().time
        greeted = (self.source, self.source.revision)
        while not page.closed:
            begin_s = clock()
            if greeted != (self.source, self.source.revision):
                greeted = (self.source, self.source.revision)
                await self._greet(page)
            frame = player.frame(begin_s)
            if frame is not None:
                await page.send_bytes(frame)
            await asyncio.sleep(max(0.0, begin_s + PERIOD_S - clock()))

    async def _say_goodbye(self, _: web.Application) -> None:
        for page in tuple(self._pages):
            await page.close(code=WSCloseCode.GOING_AWAY)

    async def _keep_following(self, _: web.Application) -> AsyncIterator[None]:
        task = asyncio.create_task(self._follow())
        yield
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task

    async def _follow(self) -> None:
        """Keep up with boats under way; when their run is over, show its recordings."""
        tried = False
        while isinstance(self.source, LiveSource):
            self.source.follow()
            folder = None if tried else self.source.over()
            if folder is not None:
                tried = True
                await self._go_over(self.source, folder)
            await asyncio.sleep(PERIOD_S / 2)

    async def _go_over(self, live: LiveSource, folder: Path) -> None:
        try:
            recorded = await asyncio.to_thread(RecordedSource, folder)
        except TwinscrewError as error:
            print(f"twinscrew: warning: no replay of the run: {error}", file=sys.stderr)
            return
        self.source = recorded
        for player in self._pages.values():
            player.goes_over(recorded)
        live.close()


async def serve(source: Source, port: socket.socket, stop: asyncio.Event, again: str = "") -> None:
    """Serve until told to stop, then close the source."""
    asyncio.get_running_loop().set_exception_handler(Complaints().tell)
    log, server = faults_of_ours(), Server(source, again)
    runner = web.AppRunner(server.app(), access_log=None, logger=log, shutdown_timeout=1.0)
    await runner.setup()
    try:
        await web.SockSite(runner, port).start()
        await stop.wait()
    finally:
        await runner.cleanup()
        server.source.close()


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
