"""Serves the page and its frames on this machine only.

Each page is sent one frame at a time: the next is made when the last is gone, at most ten a second.
A slow page therefore sees fewer frames, and nothing queues up.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Final

from aiohttp import WSCloseCode, WSMsgType, web

from twinscrew.hil_sim.viewer.complaints import Complaints, faults_of_ours
from twinscrew.hil_sim.viewer.greeting import greeting
from twinscrew.hil_sim.viewer.live import LiveSource
from twinscrew.hil_sim.viewer.loopback import only_from_here
from twinscrew.hil_sim.viewer.player import Player
from twinscrew.hil_sim.viewer.source import Source
from twinscrew.hil_sim.viewer.wire import decode_request, encode_greeting

PAGE: Final = Path(__file__).parent / "page"
FILES: Final = frozenset(path.name for path in PAGE.iterdir())
"""All that is served."""
PERIOD_S: Final = 0.1
"""[s] Between two frames: 10 Hz, the LiDAR's rate."""
HEARTBEAT_S: Final = 5.0
"""[s] A page that does not answer for this long is let go."""
LONGEST_REQUEST: Final = 1024
"""[B] What a page asks for is shorter."""


class Server:
    """Pages, each with its player, over one source."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._pages: set[web.WebSocketResponse] = set()

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
        self._pages.add(page)
        player = Player(self._source)
        sender = asyncio.create_task(self._send(page, player))
        try:
            async for message in page:
                wish = decode_request(message.data) if message.type is WSMsgType.TEXT else None
                if wish is None:
                    await page.close(code=1003, message=b"not a request")
                    break
                if wish.playing and self._source.mode == "live":
                    await self._greet(page)  # with the trails of what it paused over
                player.ask(wish)
        finally:
            self._pages.discard(page)
            sender.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await sender
        return page

    async def _greet(self, page: web.WebSocketResponse) -> None:
        await page.send_str(encode_greeting(greeting(self._source)))

    async def _send(self, page: web.WebSocketResponse, player: Player) -> None:
        clock = asyncio.get_running_loop().time
        told = self._source.revision
        while not page.closed:
            begin_s = clock()
            if told != self._source.revision:
                told = self._source.revision
                await self._greet(page)
            frame = player.frame(begin_s)
            if frame is not None:
                await page.send_bytes(frame)
            await asyncio.sleep(max(0.0, begin_s + PERIOD_S - clock()))

    async def _say_goodbye(self, _: web.Application) -> None:
        for page in tuple(self._pages):
            await page.close(code=WSCloseCode.GOING_AWAY)

    async def _keep_following(self, _: web.Application) -> AsyncIterator[None]:
        if not isinstance(self._source, LiveSource):
            yield
            return
        task = asyncio.create_task(_follow(self._source))
        yield
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


async def _follow(source: LiveSource) -> None:
    while True:
        source.follow()
        await asyncio.sleep(PERIOD_S / 2)


async def serve(source: Source, port: socket.socket, stop: asyncio.Event) -> None:
    """Serve until told to stop."""
    asyncio.get_running_loop().set_exception_handler(Complaints().tell)
    log = faults_of_ours()
    runner = web.AppRunner(Server(source).app(), access_log=None, logger=log, shutdown_timeout=1.0)
    await runner.setup()
    try:
        await web.SockSite(runner, port).start()
        await stop.wait()
    finally:
        await runner.cleanup()
