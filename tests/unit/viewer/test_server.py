"""The page's server: what it answers, whom it refuses, and that it never piles frames up."""

import asyncio
import json
import struct
from contextlib import asynccontextmanager

import pytest
from aiohttp import WSServerHandshakeError
from aiohttp.test_utils import TestClient, TestServer

from twinscrew.hil_sim.viewer.server import HOST, PAGE, PERIOD_S, Server, greeting
from twinscrew.hil_sim.viewer.sources import RecordedSource
from twinscrew.hil_sim.viewer.wire import Order, Part


@pytest.fixture(scope="module")
def source(run):
    return RecordedSource(run)


@asynccontextmanager
async def served(source):
    async with TestClient(TestServer(Server(source).app(), host=HOST)) as client:
        yield client


def with_client(source, visit):
    async def run_it():
        async with served(source) as client:
            return await visit(client)

    return asyncio.run(run_it())


def head(frame):
    (size,) = struct.unpack_from("<I", frame)
    return json.loads(frame[4 : 4 + size])


@pytest.mark.parametrize("file", sorted(path.name for path in PAGE.iterdir()))
def test_the_page_and_all_it_needs_are_served(source, file):
    async def visit(client):
        answer = await client.get(f"/{file}")
        assert answer.status == 200
        assert await answer.read() == (PAGE / file).read_bytes()
        assert "default-src 'self'" in answer.headers["Content-Security-Policy"]

    with_client(source, visit)


def test_the_page_needs_nothing_from_elsewhere():
    for path in PAGE.iterdir():
        text = path.read_text().replace("http://www.w3.org/2000/svg", "")
        assert "http://" not in text, path
        assert "https://" not in text, path


@pytest.mark.parametrize(
    "path",
    ["/../server.py", "/%2e%2e/server.py", "/..%2fserver.py", "/nothing.js", "/" + 300 * "a"],
)
def test_nothing_but_the_page_is_served(source, path):
    async def visit(client):
        assert (await client.get(path)).status == 404

    with_client(source, visit)


def test_a_visitor_is_greeted_and_then_gets_frames(source):
    async def visit(client):
        async with client.ws_connect("/frames") as page:
            told = json.loads(await page.receive_str())
            assert told["names"] == ["wamv1", "wamv2"]
            assert told["mode"] == "recording"
            assert told["duration_s"] == pytest.approx(source.duration_s, abs=0.01)
            times = [head(await page.receive_bytes())["time_s"] for _ in range(4)]
        assert times == sorted(times)
        assert times[-1] > 0

    with_client(source, visit)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost:8077", "[::1]:80", "localhost"])
def test_a_browser_on_this_machine_may_leave_out_port_80(source, host):
    async def visit(client):
        answer = await client.get("/", headers={"Host": host, "Origin": f"http://{host}"})
        assert answer.status == 200

    with_client(source, visit)


def test_a_handshake_that_is_none_is_refused_as_such(source):
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}

    async def visit(client):
        answer = await client.get("/frames", headers={**upgrade, "Sec-WebSocket-Key": "\u00e4"})
        assert answer.status == 400

    with_client(source, visit)


def test_seeking_answers_with_that_moment(source):
    async def visit(client):
        async with client.ws_connect("/frames") as page:
            await page.receive_str()
            await page.send_str('{"playing": false, "seek_s": 4.5}')
            while (frame := head(await page.receive_bytes()))["playing"]:
                pass
            assert frame["time_s"] == 4.5

    with_client(source, visit)


def test_two_pages_have_their_own_time(source):
    async def visit(client):
        async with client.ws_connect("/frames") as first, client.ws_connect("/frames") as second:
            await first.receive_str()
            await second.receive_str()
            await first.send_str('{"playing": false, "seek_s": 5.0}')
            while head(await first.receive_bytes())["playing"]:
                pass
            assert head(await second.receive_bytes())["time_s"] < 4.0

    with_client(source, visit)


def test_what_is_no_request_ends_the_conversation(source):
    async def visit(client):
        async with client.ws_connect("/frames") as page:
            await page.send_str('{"arm": true}')
            async for _ in page:
                pass
            assert page.close_code == 1003

    with_client(source, visit)


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://elsewhere.example"},
        {"Origin": "null"},
        {"Host": "elsewhere.example"},
        {"Host": "127.0.0.1.elsewhere.example:8077"},
    ],
)
def test_other_peoples_pages_are_refused(source, headers):
    async def visit(client):
        with pytest.raises(WSServerHandshakeError) as refusal:
            await client.ws_connect("/frames", headers=headers)
        assert refusal.value.status == 403

    with_client(source, visit)


class Live:
    """A recording's last moment, as if it were now."""

    mode, duration_s, begin_s = "live", 0.0, 0.0
    datum = result = None
    takes_orders = False
    revision = 0

    def __init__(self, source):
        self.names, self.scene, self._source = source.names, source.scene, source
        self.orders = []

    def now_s(self):
        return 0.0

    def trails(self):
        return self._source.trails()

    def charts(self):
        return self._source.charts()

    def series(self):
        return self._source.series()

    def events(self):
        return self._source.events()

    def order(self, order):
        self.orders.append(order)
        return "done"

    def parts(self, time_s):
        return self._source.parts(3.0)


def test_a_live_page_that_goes_on_is_told_the_trails_of_its_pause(source):
    async def visit(client):
        async with client.ws_connect("/frames") as page:
            await page.receive_str()
            await page.send_str('{"playing": false}')
            await page.send_str('{"playing": true}')
            while not isinstance(told := (await page.receive()).data, str):
                pass
            assert set(json.loads(told)["trails"]) == {"wamv1", "wamv2"}

    with_client(Live(source), visit)


def test_a_page_is_told_the_trails_again_when_the_way_before_becomes_known(source):
    live = Live(source)

    async def visit(client):
        async with client.ws_connect("/frames") as page:
            await page.receive_str()
            assert isinstance((await page.receive()).data, bytes)
            live.revision = 1
            while not isinstance(told := (await page.receive()).data, str):
                pass
            assert set(json.loads(told)["trails"]) == {"wamv1", "wamv2"}
            assert isinstance((await page.receive()).data, bytes), "told once, then it goes on"

    with_client(live, visit)


def test_a_page_that_does_not_read_gets_its_frames_made_no_faster_than_it_takes_them(source):
    made = []

    class Counted(Live):
        def parts(self, time_s):
            made.append(time_s)
            return [Part(part.head, bytes(4_000_000)) for part in super().parts(time_s)]

    async def visit(client):
        async with client.ws_connect("/frames", max_msg_size=0) as page:
            await page.receive_str()
            await asyncio.sleep(10 * PERIOD_S)  # 8 MB frames, and nobody reads
            stuck = len(made)
            await asyncio.sleep(10 * PERIOD_S)
            assert len(made) <= stuck + 1
            await page.receive_bytes()  # the line goes on once somebody does

    with_client(Counted(source), visit)


def test_an_order_is_passed_on_and_answered(source):
    live = Live(source)

    async def visit(client):
        async with client.ws_connect("/frames") as page:
            await page.receive_str()
            await page.send_str('{"order": {"vessel": "wamv1", "goal": [3.5, -2.0]}}')
            while not isinstance(told := (await page.receive()).data, str):
                pass
            assert json.loads(told) == {"answer": "done"}

    with_client(live, visit)
    assert live.orders == [Order(vessel="wamv1", goal=(3.5, -2.0))]


def test_a_recording_takes_no_orders(source):
    async def visit(client):
        async with client.ws_connect("/frames") as page:
            assert json.loads(await page.receive_str())["orders"] is False
            await page.send_str('{"order": {"vessel": "wamv1"}}')
            while not isinstance(told := (await page.receive()).data, str):
                pass
            assert json.loads(told) == {"answer": "refused: wamv1 is a recording"}

    with_client(source, visit)


@pytest.mark.parametrize(
    "order", ['{"vessel": 3}', '{"goal": [1, 2]}', '{"vessel": "a", "goal": [1]}']
)
def test_an_order_that_is_none_ends_the_conversation(source, order):
    async def visit(client):
        async with client.ws_connect("/frames") as page:
            await page.send_str(f'{{"order": {order}}}')
            async for _ in page:
                pass
            assert page.close_code == 1003

    with_client(source, visit)


def test_a_page_is_told_how_its_view_is_started_again(source):
    again = greeting(source, "twinscrew view --replay run --port 8077")["again"]
    assert again == "twinscrew view --replay run --port 8077"
