"""Keeping watch by the page, in a real browser: what it shows, warns of, and may order."""

import json
import re
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from tests.harness.boats import Boats
from tests.harness.page import (
    DESKTOP,
    PATIENCE_S,
    PHONE,
    Viewer,
    drawn_on,
    frames,
    labels,
    pause,
    seek,
    style_colour,
    told,
    until,
    visit,
    wants_chromium,
)

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.hil_sim.viewer.scene import read_outcomes, write_scene
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recording import find_recordings
from twinscrew.runtime.safety.explain import closest_approach

pytestmark = [pytest.mark.slow, wants_chromium]
WATCH_WORDS = """
    window.words = [];
    const write = CanvasRenderingContext2D.prototype.fillText;
    CanvasRenderingContext2D.prototype.fillText = function (words, ...rest) {
        if (this.canvas.id === "chart") window.words.push(words);
        return write.call(this, words, ...rest);
    };
"""
"""Keeps what is written on the chart, in the order of writing."""


def sailed(folder, scenario, **settings):
    # The policy of the default vessel alone: what it does in these encounters is what is drawn.
    policy = {"policy": "ac_iqn_wam_v", **settings}
    sail(scenario, SitlSettings(lockstep=True, **policy), folder)
    write_scene(folder, scenario)
    return folder


@pytest.fixture(scope="module")
def five(tmp_path_factory):
    """Five boats among buoys, for 13 s: two of them meet head-on."""
    scenario = replace(load_scenario("random", vessels=5, buoys=4, seed=3), time_limit_s=13.0)
    return sailed(tmp_path_factory.mktemp("five"), scenario, seed=3)


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    """One boat, from start to goal."""
    scenario = load_scenario("random", vessels=1, buoys=2, seed=3)
    folder = sailed(tmp_path_factory.mktemp("one"), scenario, seed=3)
    result = [
        {"name": "wamv1", "outcome": "goal", "travel_time_s": 13.3, "closest_approach_m": 9.7}
    ]
    (folder / "summary.json").write_text(json.dumps({"success": True, "vessels": result}))
    return folder


@pytest.fixture(scope="module")
def of_five(five):
    viewer = Viewer("--replay", str(five))
    yield viewer
    viewer.stop()


@pytest.fixture(scope="module")
def of_one(one):
    viewer = Viewer("--replay", str(one))
    yield viewer
    viewer.stop()


@pytest.fixture
def desktop(page):
    page.set_viewport_size(DESKTOP)
    page.add_init_script(WATCH_WORDS)
    return page


def still(page, viewer, seconds):
    """Show one moment, and all of the map."""
    visit(page, viewer)
    pause(page)
    seek(page, seconds)
    until(lambda: float(told(page, "time")) == seconds)
    page.wait_for_timeout(150)


def vessels(page):
    return page.evaluate(
        """twinscrew.model.vessels.map(({ name, pose, velocity, tracks, why, ended }) =>
            ({ name, pose, velocity, tracks, why, ended }))"""
    )


def on_screen(page, place):
    """Give where a place, north and east [m], is in the window [px]."""
    x, y = page.evaluate(
        "([n, e]) => [twinscrew.chart.camera.x(e), twinscrew.chart.camera.y(n)]", place
    )
    box = page.locator("#chart").bounding_box()
    return box["x"] + x, box["y"] + y


def overlap(a, b):
    wide = min(a["x"] + a["width"], b["x"] + b["width"]) - max(a["x"], b["x"])
    high = min(a["y"] + a["height"], b["y"] + b["height"]) - max(a["y"], b["y"])
    return max(wide, 0.0) * max(high, 0.0)


# -------------------------------------------------------------------------------- arrived boats


def test_an_arrived_boat_is_drawn_where_it_is_held_without_way_or_alarm(desktop, of_one, one):
    visit(desktop, of_one)
    pause(desktop)
    desktop.evaluate("twinscrew.chart.canvas.focus()")
    end_s = float(desktop.locator("#slider").get_attribute("max"))
    seek(desktop, end_s)
    until(lambda: vessels(desktop)[0]["ended"] is not None)
    (boat,) = vessels(desktop)
    held = read_outcomes(one)["wamv1"]
    assert boat["pose"][:2] in [list(row.pose[:2]) for row in held]
    assert boat["velocity"] == [0, 0]
    assert desktop.locator(".card .state").inner_text() == "arrived"
    assert desktop.locator(".card.silent").count() == 0
    assert told(desktop, "alarms") == "0"
    assert "wamv1\narrived" in [label["words"] for label in labels(desktop)]
    assert desktop.locator("#result").inner_text().startswith("arrived, nothing came nearer than")
    desktop.locator("[aria-controls=watch-events]").click()
    assert desktop.locator("#events [data-severity=error]").count() == 0
    assert "arrived" in desktop.locator("#events li").first.inner_text()


# --------------------------------------------------------------------- labels, legend and zones


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_every_boat_has_a_label_that_lies_on_no_other(page, of_five, size):
    page.set_viewport_size(size)
    still(page, of_five, 12.0)
    boats = labels(page)
    for number in range(1, 6):
        (label,) = [one for one in boats if one["words"].startswith(f"wamv{number}\n")]
        assert re.search(r"\d\.\d m/s \d\d\d\u00b0", label["words"]), "speed and course"
        assert re.search(r"\d+ m to goal", label["words"])
    for i, one in enumerate(boats):
        assert one["x"] >= 0
        assert one["x"] + one["width"] <= size["width"]
        for other in boats[:i]:
            assert overlap(one, other) == 0.0, (one["words"], other["words"])


def test_a_zone_names_its_rule_and_the_two(desktop, of_five):
    two = re.compile(r"rule 1[45]: wamv(\d) (meets|gives way to) wamv(?!\1)\d")
    for second in range(1, 20):
        still(desktop, of_five, float(second))
        if any(two.match(one["words"]) for one in labels(desktop)):
            return
    pytest.fail("no zone named its rule, and two vessels, in 20 s of five vessels that meet")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_boat_has_the_colour_of_a_zone_or_of_an_alarm(page, of_five, scheme):
    page.emulate_media(color_scheme=scheme)
    visit(page, of_five)
    boats = [np.array(style_colour(page, f"v{index}")) for index in range(8)]
    for special in ("zone", "danger"):
        colour = np.array(style_colour(page, special))
        assert min(np.abs(colour - boat).sum() for boat in boats) > 90, special
    for i, boat in enumerate(boats):
        assert all(np.abs(boat - other).sum() > 40 for other in boats[:i]), "told apart"


def test_five_boats_fit_beside_the_chart_with_what_they_do_and_why(desktop, of_five):
    still(desktop, of_five, 12.0)
    window = {"x": 0, "y": 0, **DESKTOP}
    side = desktop.locator("#vessels").bounding_box()
    for card in desktop.locator(".card").all():
        box = card.bounding_box()
        assert overlap(box, side) == pytest.approx(box["width"] * box["height"], rel=0.01)
        assert overlap(box, window) == pytest.approx(box["width"] * box["height"], rel=0.01)
        assert card.locator(".why").inner_text()
    assert desktop.locator("#tracks tr").count() >= 5
    assert desktop.locator("#watch").bounding_box()["height"] > 150


def test_a_legend_says_what_is_drawn(desktop, of_five):
    visit(desktop, of_five)
    desktop.locator("#legend summary").click()
    words = desktop.locator("#legend li").all_inner_texts()
    assert len(words) >= 9
    for thing in ("boat", "goal", "track", "object", "echoes", "COLREGs", "too near", "buoy"):
        assert any(thing in line for line in words), thing


# --------------------------------------------------------------------- ends and lost connections


def test_a_lost_connection_says_what_can_be_done(page, one):
    viewer = Viewer("--replay", str(one))
    visit(page, viewer)
    viewer.stop()
    until(lambda: page.locator("#notice").is_visible())
    until(lambda: "s ago" in page.locator("#notice-words").inner_text())
    command = page.locator("#notice code").inner_text()
    assert command == f"twinscrew view --replay {one} --port {viewer.port}"


def test_a_run_in_real_time_goes_over_into_its_replay_with_the_result(page, tmp_path):
    command = [sys.executable, "-m", "twinscrew.runtime.cli", "sitl", "--vessels", "1"]
    command += ["--buoys", "2", "--seed", "3", "--out", str(tmp_path / "run")]
    said = tmp_path / "said.txt"
    with said.open("w") as log:
        sitl = subprocess.Popen([*command, "--view", "--port", "0"], stdout=log, stderr=log)
        try:
            until(lambda: re.search(r"http://[\d.:]+", said.read_text()))
            page.goto(re.search(r"http://[\d.:]+", said.read_text())[0])
            until(lambda: page.locator(".state[data-state=active]").count() == 1)
            autopilot = page.locator(".card .autopilot")
            until(lambda: "MANUAL, armed" in autopilot.inner_text())
            assert "policy drives" in autopilot.inner_text()
            assert page.locator(".send").is_visible() is False, "no orders unless switched on"
            until(lambda: told(page, "mode") == "recording")
            assert page.locator("#mode").inner_text() == "replay, random"
            assert "The run is over" in page.locator("#notice-words").inner_text()
            until(lambda: page.locator(".card .state").inner_text() in {"arrived", "out of time"})
            assert told(page, "alarms") == "0"
            seek(page, 2.0)
            assert page.locator(".card .state").inner_text() == "active"
        finally:
            sitl.send_signal(signal.SIGINT)
            sitl.wait(PATIENCE_S)
    until(lambda: told(page, "connection") == "lost")
    assert sitl.returncode in {0, 1}, said.read_text()


# ---------------------------------------------------------------------------------------- a phone


def test_on_a_phone_the_chart_has_two_thirds_and_the_slider_a_thumbs_width(page, of_five):
    page.set_viewport_size(PHONE)
    still(page, of_five, 12.0)
    head = page.locator("header").bounding_box()
    assert head["height"] < 60, "one row"
    chart = page.locator("#chart").bounding_box()
    assert chart["height"] == pytest.approx(PHONE["height"] * 2 / 3, abs=3.0)
    assert chart["width"] == PHONE["width"]
    slider = page.locator("#slider").bounding_box()
    assert slider["width"] > 0.9 * PHONE["width"]
    assert slider["height"] >= 36
    assert slider["y"] + slider["height"] <= PHONE["height"], "in sight without scrolling"
    page.mouse.click(slider["x"] + slider["width"] / 2, slider["y"] + slider["height"] / 2)
    length_s = float(page.locator("#slider").get_attribute("max"))
    until(lambda: float(told(page, "time")) == pytest.approx(length_s / 2, abs=0.5))
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    page.locator("#layers-button").click()
    page.locator("#layers input[name=points]").uncheck()
    page.locator("#watch").scroll_into_view_if_needed()
    assert page.locator("#tracks tr").first.is_visible()


# ------------------------------------------------------------------------------------- the watch


def test_every_track_has_its_closest_approach(desktop, of_five):
    still(desktop, of_five, 12.0)
    compared, urgent = 0, []
    for boat in vessels(desktop):
        for track in boat["tracks"]:
            if track["tcpa"] > 0 and not boat["ended"]:
                other = track["name"] or f"track {track['id']}"
                rule = {1: "14", 2: "15"}.get(track["situation"], "")
                urgent.append((track["cpa"] + track["tcpa"] / 2, boat["name"], other, rule))
            p = np.array([[track["north"], track["east"]]]) - boat["pose"][:2]
            v = np.array([[track["vNorth"], track["vEast"]]]) - boat["velocity"]
            near = closest_approach(p, v, np.array([track["radius"]]))
            speed, time_s = np.hypot(*v[0]), near.tcpa_s[0]
            if speed < 0.2:
                continue  # hundredths of m/s, as the page has them, make too much of a difference
            assert track["cpa"] == pytest.approx(near.cpa_m[0], abs=0.3 + 0.02 * time_s)
            assert track["tcpa"] == pytest.approx(time_s, abs=0.6 + 0.02 * time_s / speed)
            compared += 1
    assert compared > 5
    first = desktop.locator("#tracks tr").first.inner_text().split("\t")
    _, own, other, rule = min(urgent)
    assert first[:2] == [own, other]
    assert first[-1] == rule or (not rule and first[-1] == "still")


def limit(page, cpa_m, tcpa_s):
    for name, value in (("cpa", cpa_m), ("tcpa", tcpa_s)):
        page.locator(f"#{name}-limit").fill(str(value))
        page.locator(f"#{name}-limit").press("Enter")


def test_an_alarm_wants_to_be_acknowledged_and_is_kept_in_the_book(desktop, of_five):
    still(desktop, of_five, 12.0)
    limit(desktop, 0, 0)
    seek(desktop, 11.9)
    until(lambda: told(desktop, "alarms") == "0")
    assert not desktop.locator("#alarms").is_visible()
    limit(desktop, 3, 20)
    until(lambda: int(told(desktop, "alarms")) > 1)
    count = int(told(desktop, "alarms"))
    active = desktop.locator("#alarms li[data-state=active]")
    assert re.search(r"(CPA|contact).* in \d", active.first.inner_text())
    active.first.get_by_role("button").click()
    until(lambda: int(told(desktop, "alarms")) == count - 1)
    assert desktop.locator("#alarms li[data-state=acknowledged]").count() >= 1 or count > 3
    desktop.locator("#chart").focus()
    desktop.keyboard.press("k")
    until(lambda: told(desktop, "alarms") == "0")
    desktop.locator("[aria-controls=watch-events]").click()
    assert desktop.locator("#events li[data-name=acknowledged]").count() == count


def test_limits_are_remembered(desktop, of_five):
    still(desktop, of_five, 12.0)
    limit(desktop, 2.5, 9)
    desktop.reload()
    until(lambda: frames(desktop) >= 3)
    assert desktop.locator("#cpa-limit").input_value() == "2.5"
    assert desktop.locator("#tcpa-limit").input_value() == "9"


def test_a_boat_says_what_it_does_and_why_as_its_runtime_recorded_it(desktop, of_five, five):
    still(desktop, of_five, 12.0)
    for recording in find_recordings(five):
        said = {
            cdr.decode_explanation(message.payload).sentence
            for message in recording.messages(("explanation",))
        }
        (boat,) = [boat for boat in vessels(desktop) if boat["name"] == recording.vessel]
        assert boat["why"] in said
    desktop.keyboard.press("3")
    words = desktop.locator(".card").nth(2).locator(".why").inner_text()
    named = re.compile(r"wamv\d|track \d+")  # the page names tracks that it knows
    assert named.sub("it", words) == named.sub("it", vessels(desktop)[2]["why"])


def test_events_are_listed_and_lead_to_their_moment(desktop, of_five):
    still(desktop, of_five, 12.0)
    desktop.locator("[aria-controls=watch-events]").click()
    lines = desktop.locator("#events li")
    assert lines.count() > 5
    line = desktop.locator("#events li[data-name=goal_set]").first
    moment = float(line.get_attribute("data-time"))
    line.click()
    until(lambda: float(told(desktop, "time")) == pytest.approx(moment, abs=0.11))
    assert drawn_on(desktop, "#marks") > 20


def test_wind_is_on_the_chart(desktop, of_five):
    still(desktop, of_five, 12.0)
    assert "wind 10.0 m/s from 090\u00b0" in desktop.evaluate("window.words")


def test_the_pointer_has_coordinates_and_a_bearing_from_the_followed_boat(desktop, of_five):
    still(desktop, of_five, 12.0)
    desktop.mouse.move(*on_screen(desktop, [20.0, 30.0]))
    output = desktop.locator("#place")
    until(lambda: output.is_visible())
    north, east = map(float, re.search(r"N (\S+) m  E (\S+) m", output.inner_text()).groups())
    assert (north, east) == (pytest.approx(20.0, abs=0.2), pytest.approx(30.0, abs=0.2))
    desktop.keyboard.press("1")
    desktop.mouse.move(*on_screen(desktop, [20.0, 30.0]))
    until(lambda: "of wamv1" in output.inner_text())


def test_the_ruler_measures_between_boats(desktop, of_five):
    still(desktop, of_five, 12.0)
    (x0, y0), (x1, y1) = [boat["pose"][:2] for boat in vessels(desktop)[:2]]
    desktop.locator("#chart").focus()
    desktop.keyboard.press("m")
    desktop.mouse.move(*on_screen(desktop, [x0, y0]))
    desktop.mouse.down()
    desktop.mouse.move(*on_screen(desktop, [x1, y1]), steps=3)
    desktop.mouse.up()
    metres = np.hypot(x1 - x0, y1 - y0)
    degrees = round(np.degrees(np.arctan2(y1 - y0, x1 - x0))) % 360
    words = f"{metres:.1f} m, {degrees:03d}\u00b0"
    until(lambda: words in desktop.evaluate("window.words"))
    seek(desktop, 5.0)
    moved = [boat["pose"][:2] for boat in vessels(desktop)[:2]]
    again = f"{np.hypot(*np.subtract(*moved)):.1f} m"
    until(lambda: any(again in said for said in desktop.evaluate("window.words.slice(-60)")))
    desktop.keyboard.press("Escape")
    assert desktop.evaluate("twinscrew.chart.measure") is None


def test_a_link_leads_to_its_moment_and_its_boat(desktop, of_five):
    still(desktop, of_five, 7.3)
    desktop.keyboard.press("2")
    desktop.keyboard.press("l")
    until(lambda: "#t=7.3" in desktop.url)
    assert "follow=wamv2" in desktop.url
    linked = desktop.url
    desktop.goto("about:blank")
    desktop.goto(linked)
    until(lambda: told(desktop, "time") == "7.3")
    assert told(desktop, "following") == "wamv2"
    assert desktop.locator("#play").inner_text() == "Play", "it waits there"


def test_figures_over_time_are_drawn_and_lead_to_their_moment(desktop, of_five):
    still(desktop, of_five, 12.0)
    desktop.locator("[aria-controls=watch-figures]").click()
    until(lambda: drawn_on(desktop, "#figures") > 1000)
    box = desktop.locator("#figures").bounding_box()
    desktop.mouse.click(box["x"] + 0.6 * box["width"], box["y"] + 30)
    length_s = float(desktop.locator("#slider").get_attribute("max"))
    until(lambda: 0.3 * length_s < float(told(desktop, "time")) < 0.8 * length_s)


# -------------------------------------------------------------------------------------- orders


@pytest.fixture
def boats(five, endpoint):
    boats = Boats(five, endpoint)
    yield boats
    boats.close()


def test_a_page_without_orders_has_no_button_for_any(desktop, boats, endpoint):
    viewer = Viewer("--connect", endpoint, "--names", "wamv1")
    try:
        visit(desktop, viewer)
        assert desktop.locator(".send:visible, .halt:visible").count() == 0
    finally:
        viewer.stop()


def test_an_order_needs_a_place_and_a_confirmation(desktop, boats, endpoint):
    heard = []
    for topic in ("goal", "route"):
        ZenohBus.subscribe(boats.bus.within("wamv1"), topic, lambda m: heard.append(m))
    viewer = Viewer("--connect", endpoint, "--names", "wamv1", "--orders")
    try:
        visit(desktop, viewer)
        until(lambda: vessels(desktop)[0]["pose"] is not None)
        desktop.locator(".send").click()
        box = desktop.locator("#chart").bounding_box()
        place = box["x"] + 0.6 * box["width"], box["y"] + 0.6 * box["height"]
        desktop.mouse.click(*place)
        assert desktop.locator("#confirm-title").inner_text() == "Send wamv1?"
        assert "bearing" in desktop.locator("#confirm-words").inner_text()
        desktop.keyboard.press("Enter")  # the button that has the focus is Cancel
        until(lambda: not desktop.locator("#confirm").is_visible())
        desktop.locator(".send").click()
        desktop.mouse.click(*place)
        desktop.locator("#confirm-yes").click()
        until(lambda: heard)
        wanted = re.search(r"north (\S+) m, east (\S+) m", told(desktop, "answer")).groups()
        sent = cdr.decode_goal(heard[0].payload).position_N
        assert [heard[0].topic, len(heard)] == ["goal", 1], "what was cancelled was not sent"
        np.testing.assert_allclose(sent, [float(value) for value in wanted], atol=0.06)
        desktop.locator(".halt").click()
        desktop.locator("#confirm-yes").click()
        until(lambda: len(heard) == 2)
        assert heard[1].topic == "route"
        assert len(cdr.decode_path(heard[1].payload)[1]) == 0
    finally:
        viewer.stop()


def test_a_simulated_run_takes_orders_only_in_real_time_and_with_a_page():
    for options in (["--orders"], ["--orders", "--view", "--lockstep"]):
        command = [sys.executable, "-m", "twinscrew.runtime.cli", "sitl", *options]
        refused = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
        assert refused.returncode == 2
        assert "--orders: only with --view" in refused.stderr
