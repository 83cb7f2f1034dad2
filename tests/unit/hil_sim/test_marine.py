"""The simulated AIS receivers and radars say what is there, as badly as real ones."""

from dataclasses import replace

import numpy as np
import pytest

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sensors.marine import (
    OWN_MMSI,
    TRAFFIC_MMSI,
    AisTransponders,
    MarineSensors,
    MarineSettings,
    RadarUnit,
)
from twinscrew.hil_sim.traffic import TrafficEntry
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.datum import Datum
from twinscrew.runtime.messages.marine import decode_radar_scan, decode_sentence
from twinscrew.runtime.senses.ais import Ais, AisSettings

pytestmark = pytest.mark.slow
DATUM = Datum(latitude_deg=-33.7221, longitude_deg=150.6739)
SHIP = TrafficEntry(
    start_m=(200.0, 150.0), course_deg=270.0, speed_mps=4.0, length_m=20.0, beam_m=6.0, name="NORD"
)


def heard(seconds, traffic=(SHIP,), **settings):
    """Let a world pass with its vessels at their moorings; give what each sensor said, and when."""
    scenario = replace(load_scenario("crossing"), sea="paper", traffic=tuple(traffic))
    world = make_world(scenario, seed=3)
    for i in range(2):
        world.moor(i, scenario.starts[i, :2])
    sensors = MarineSensors(world, MarineSettings(**settings), DATUM)
    world.release(1)  # traffic gets under way
    world.moor(1, scenario.starts[1, :2])
    found = []
    for _ in range(round(seconds / 0.5)):
        world.advance(0.5, np.zeros((2, 2)))
        found += [(world.time_s, sensed) for sensed in sensors.take()]
    return world, found


def test_every_vessel_hears_the_others_and_itself_as_itself():
    _, found = heard(45.0, ais=AisTransponders(loss=0.0))
    for own in (0, 1):
        texts = [decode_sentence(s.payload).text for _, s in found if s.vessel == own]
        ais = Ais(AisSettings(datum=DATUM, own_echo_m=0.0))
        for text in texts:
            if "VDM" in text:
                payload = next(
                    s.payload for _, s in found if decode_sentence(s.payload).text == text
                )
                ais.take(payload, 0, lambda _ns: None)
        targets = ais.targets(0)
        assert set(targets.id.tolist()) == {TRAFFIC_MMSI, OWN_MMSI + 1 - own}
        assert any("VDO" in text for text in texts)


def test_a_ship_reports_where_it_is_within_its_errors_every_ten_seconds():
    world, found = heard(
        120.0, ais=AisTransponders(own_vessels=False, loss=0.0, delay_s=(0.0, 0.0))
    )
    ais, errors, times = Ais(AisSettings(datum=DATUM)), [], []
    for time_s, sensed in found:
        if sensed.vessel == 0:
            for look in ais.take(sensed.payload, 0, lambda _ns: None).looks:
                if look.extras[0].names_only:
                    continue
                truth = np.array([200.0, 150.0 - 4.0 * time_s])
                errors.append(np.hypot(*(look.z[0] - truth)))
                times.append(time_s)
                assert look.extras[0].named.name.endswith("NORD") or time_s < 5.0
    assert 9.0 <= np.diff(times).mean() <= 11.0
    assert 0.5 < np.mean(errors) < 10.0
    assert world.traffic.position_N[0, 1] == pytest.approx(150.0 - 480.0)


def test_class_b_reports_less_often_than_class_a():
    ship_b = TrafficEntry(
        start_m=(100.0, -60.0),
        course_deg=90.0,
        speed_mps=3.0,
        length_m=8.0,
        beam_m=2.5,
        ais="B",
    )
    silent = TrafficEntry(
        start_m=(0.0, 90.0), course_deg=0.0, speed_mps=3.0, length_m=8.0, beam_m=2.5, ais="none"
    )
    _, found = heard(
        100.0, (SHIP, ship_b, silent), ais=AisTransponders(own_vessels=False, loss=0.0)
    )
    ais, count = Ais(AisSettings(datum=DATUM)), {}
    for _, sensed in found:
        if sensed.vessel == 0:
            for look in ais.take(sensed.payload, 0, lambda _ns: None).looks:
                who = look.extras[0].named.identity
                count[who] = count.get(who, 0) + (not look.extras[0].names_only)
    assert count == {
        f"{TRAFFIC_MMSI}": pytest.approx(10, abs=2),
        f"{TRAFFIC_MMSI + 1}": pytest.approx(3, abs=1),
    }


def test_some_reports_are_lost():
    few = heard(120.0, ais=AisTransponders(own_vessels=False, loss=0.5))[1]
    all_ = heard(120.0, ais=AisTransponders(own_vessels=False, loss=0.0))[1]
    assert len(few) < len(all_)


def test_a_radar_shows_the_ship_the_buoys_and_the_sea():
    unit = RadarUnit()
    world, found = heard(30.0, radar=unit)
    scans = [decode_radar_scan(s.payload) for _, s in found if s.vessel == 0]
    assert len(scans) == pytest.approx(30.0 / unit.turn_s, abs=1)
    own, heading = world.state.position_N[0, :2], world.state.heading[0]
    seen, clutter = 0, []
    for scan in scans:
        towards = scan.bearing_rad + heading
        p_N = own + scan.range_m[:, None] * np.column_stack([np.cos(towards), np.sin(towards)])
        t = (scan.stamp_ns - world.epoch_ns) * 1e-9
        off = np.hypot(*(p_N - (200.0, 150.0 - 4.0 * t)).T)
        seen += bool((off < 25.0).any())
        clutter.append(int((scan.range_m < 150.0).sum()))
        cells = scan.range_m / unit.cell_m - 0.5
        np.testing.assert_allclose(cells, np.round(cells), atol=1e-4)
    assert seen >= 0.8 * len(scans)
    assert 2.0 < np.mean(clutter) < 60.0


def test_the_same_seed_gives_the_same_messages():
    both = [heard(20.0, ais=AisTransponders(), radar=RadarUnit())[1] for _ in range(2)]
    assert [s for _, s in both[0]] == [s for _, s in both[1]]
    assert len(both[0]) > 10
