"""Watching boats over Zenoh: real sockets, and the bytes of a real run."""

import asyncio
import json
import shutil
import time
from dataclasses import replace

import numpy as np
import pytest
from aiohttp.test_utils import TestClient, TestServer
from tests.harness.boats import Boats

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.hil_sim.viewer import sources
from twinscrew.hil_sim.viewer.scene import write_scene
from twinscrew.hil_sim.viewer.server import HOST, Server
from twinscrew.hil_sim.viewer.wire import Order
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.errors import BusError, ConfigError
from twinscrew.runtime.messages import cdr

pytestmark = pytest.mark.slow

PATIENCE_S = 200.0


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    scenario = replace(load_scenario("head_on"), time_limit_s=3.0)
    sail(scenario, SitlSettings(lockstep=True), folder)
    write_scene(folder, scenario)
    return folder


@pytest.fixture
def boats(run, endpoint):
    boats = Boats(run, endpoint)
    yield boats
    boats.close()


def views(source):
    source.follow()
    return [json.loads(part.head) for part in source.parts(source.now_s())]


def until(condition):
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s, "waited in vain"
        time.sleep(0.02)


def complete(view):
    return view["pose"] is not None and view["points"] > 0 and view["decisions"] > 0


def test_a_viewer_sees_all_boats_of_an_endpoint(boats, endpoint):
    source = sources.from_endpoint(endpoint, "wamv1, wamv2", "vrx32")
    try:
        until(lambda: all(complete(view) for view in views(source)))
        until(lambda: all(view["goal"] is not None for view in views(source)))
        shown = {view["name"]: view for view in views(source)}
        assert list(shown) == ["wamv1", "wamv2"]
        for name, odometry in boats.last.items():
            place = np.array(shown[name]["pose"][:2])
            assert np.hypot(*(place - odometry.position_N[:2])) < 6.0, "the way of those messages"
        assert set(source.trails()) == {"wamv1", "wamv2"}
    finally:
        source.close()


def test_a_viewer_never_says_a_word(boats, endpoint):
    heard = []
    for name in boats.said:
        for topic in ("goal", "engagement", "thrust_left", "thrust_right"):
            ZenohBus.subscribe(boats.bus.within(name), topic, lambda m: heard.append(m.topic))
    boats._stop.set()
    boats._thread.join()
    heard.clear()
    source = sources.from_endpoint(endpoint, "wamv1,wamv2", "vrx32")
    for _ in range(20):
        views(source)
        time.sleep(0.01)
    source.close()
    assert heard == []


def test_a_viewer_that_nobody_looks_at_keeps_a_bounded_number_of_messages(boats, endpoint):
    source = sources.from_endpoint(endpoint, "wamv1", "vrx32")
    try:
        until(lambda: source._inboxes[0].passed_over.get("odometry", 0) > 200)
        assert len(source._inboxes[0].wait(0.0)) < 300
    finally:
        source.close()


def test_a_viewer_finds_the_boats_again_after_they_were_away(run, endpoint):
    boats = Boats(run, endpoint)
    source = sources.from_endpoint(endpoint, "wamv1", "vrx32")
    try:
        until(lambda: complete(views(source)[0]))
        boats.close()
        until(lambda: views(source)[0]["silent_s"] > 1.0)
        assert views(source)[0]["points"] == 0
        boats = Boats(run, endpoint)
        until(lambda: views(source)[0]["silent_s"] < 0.5)
    finally:
        source.close()
        boats.close()


def test_a_boats_own_configuration_tells_where_it_is(boats, endpoint, tmp_path):
    file = tmp_path / "boat.toml"
    file.write_text(f'name = "wamv2"\nsensor = "vrx32"\n[bus]\nconnect = ["{endpoint}"]\n')
    source = sources.from_configs([file])
    try:
        until(lambda: complete(views(source)[0]))
        assert source.names == ("wamv2",)
    finally:
        source.close()


def heard_of(boats, name, *topics):
    heard = []
    for topic in topics:
        face = boats.bus.within(name)
        ZenohBus.subscribe(face, topic, lambda m: heard.append((m.topic, m.payload)))
    return heard


def test_orders_are_refused_unless_they_were_switched_on(boats, endpoint):
    heard = heard_of(boats, "wamv1", "goal", "route")
    source = sources.from_endpoint(endpoint, "wamv1", "vrx32")
    try:
        assert not source.takes_orders
        said = source.order(Order(vessel="wamv1", goal=(1.0, 2.0)))
        assert said.startswith("refused: this view was started without --orders")
        time.sleep(0.3)
        assert heard == []
    finally:
        source.close()


def test_an_order_is_a_goal_and_a_stop_is_an_empty_route(boats, endpoint):
    heard = heard_of(boats, "wamv2", "goal", "route")
    of_the_other = heard_of(boats, "wamv1", "goal", "route")
    source = sources.from_endpoint(endpoint, "wamv1,wamv2", "vrx32", orders=True)
    try:
        until(lambda: complete(views(source)[1]))
        said = source.order(Order(vessel="wamv2", goal=(12.5, -3.0)))
        assert said == "wamv2: sent to north 12.5 m, east -3.0 m"
        until(lambda: len(heard) == 1)
        assert cdr.decode_goal(heard[0][1]).position_N.tolist() == [12.5, -3.0]
        assert source.order(Order(vessel="wamv2")) == "wamv2: told to stop"
        until(lambda: len(heard) == 2)
        assert heard[1][0] == "route"
        assert len(cdr.decode_path(heard[1][1])[1]) == 0
        assert "no vessel 'wamv9'" in source.order(Order(vessel="wamv9"))
        assert "nowhere" in source.order(Order(vessel="wamv2", goal=(float("inf"), 0.0)))
        assert of_the_other == []
    finally:
        source.close()


def test_a_run_that_ends_goes_over_into_its_replay_with_the_result(run, boats, endpoint, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    for name in boats.said:
        text = f'name = "{name}"\nsensor = "vrx32"\n[bus]\nconnect = ["{endpoint}"]\n'
        (folder / name / "runtime.toml").write_text(text)
    source = sources.from_run(folder)

    async def visit():
        server = Server(source)
        async with (
            TestClient(TestServer(server.app(), host=HOST)) as client,
            client.ws_connect("/frames") as page,
        ):
            assert json.loads(await page.receive_str())["mode"] == "live"
            vessels = [
                {"name": name, "outcome": "timeout", "travel_time_s": 3.0} for name in source.names
            ]
            done = {"success": False, "vessels": vessels}
            (folder / "summary.json").write_text(json.dumps(done))
            greeting = {"mode": "live"}
            while greeting["mode"] == "live":
                told = (await page.receive()).data
                greeting = json.loads(told) if isinstance(told, str) else greeting
            assert greeting["mode"] == "recording"
            assert greeting["result"]["success"] is False
            frame = (await page.receive()).data
            head = json.loads(frame[4 : 4 + int.from_bytes(frame[:4], "little")])
            assert head["playing"] is False
            assert head["time_s"] == pytest.approx(greeting["duration_s"], abs=0.01)
            assert {vessel["state"] for vessel in head["vessels"]} == {"timeout"}
            assert isinstance(server.source, sources.RecordedSource)

    asyncio.run(visit())


def test_an_endpoint_where_nobody_is_is_refused(endpoint):
    with pytest.raises(BusError, match="cannot be opened"):
        sources.from_endpoint(endpoint, "wamv1", "vrx32")


@pytest.mark.parametrize("names", ["", " , "])
def test_no_name_is_refused(names, endpoint):
    with pytest.raises(ConfigError, match="--names"):
        sources.from_endpoint(endpoint, names, "vrx32")


def test_a_folder_where_nothing_sails_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="no run in real time"):
        sources.from_run(tmp_path)
