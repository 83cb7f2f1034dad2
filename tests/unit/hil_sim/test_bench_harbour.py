import numpy as np
import pytest

from twinscrew.hil_sim.bench import harbour, harbour_scenes
from twinscrew.hil_sim.bench.harbour import HarbourScore
from twinscrew.hil_sim.bench.harbour_scenes import OWN, Body, passage, sights
from twinscrew.hil_sim.shapes import load_shape
from twinscrew.runtime.perception.sensor import load_sensor

SENSOR = load_sensor("vrx32")


@pytest.fixture
def body() -> Body:
    return Body(load_shape("light_buoy"), np.zeros(2), np.pi / 2, 2.0, tilts=True)


def test_a_body_goes_where_it_heads(body: Body) -> None:
    np.testing.assert_allclose(body.v_N, [0.0, 2.0], atol=1e-12)


def test_a_passage_has_quays_that_stand_and_one_ship_beside_the_own_vessel() -> None:
    for seed in range(20):
        own, *others = passage(np.random.default_rng(seed))
        quays, ships = others[:-1], others[-1:]
        assert own.tilts
        assert own.speed >= 1.0
        assert len(quays) in (1, 2)
        assert all(quay.speed == 0.0 and not quay.tilts for quay in quays)
        assert ships[0].tilts


def test_what_is_seen_belongs_to_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(harbour_scenes, "PASSAGE_S", 2.0)
    rng = np.random.default_rng(3)
    bodies = passage(rng)
    seen = list(sights(SENSOR, bodies, rng))
    assert [sight.odometry.stamp_ns for sight in seen] == [k * 100_000_000 for k in range(20)]
    for sight in seen:
        assert len(sight.body) == len(sight.objects.radius)
        assert all(OWN < row < len(bodies) for row in sight.body)


def test_the_score_tells_quays_and_ships_under_way_apart(body: Body) -> None:
    score = HarbourScore()
    quay = Body(body.shape, body.start_N, 0.0)
    moored = Body(body.shape, body.start_N, 0.0, tilts=True)
    for v_N in ([0.0, 0.0], [3.0, 4.0]):
        score.add(quay, np.array(v_N))
        score.add(moored, np.array(v_N))
        score.add(body, np.array(v_N))
    assert score.figures() == {
        "quay_reports": 2,
        "quays_fast_share": 0.5,
        "quay_speed_rms_mps": pytest.approx(np.sqrt(12.5)),
        "ship_reports": 2,
        "ships_slow_share": 0.5,
        "ship_velocity_median_mps": pytest.approx((2.0 + np.hypot(3.0, 2.0)) / 2),
    }


@pytest.mark.slow
def test_with_the_outline_quays_stand_and_ships_are_as_fast_as_without(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(harbour, "PASSAGES", 2)
    figures = harbour.run()["harbour"]
    told, untold = figures["tracker"], figures["without_outline"]
    assert told["quays_fast_share"] < 0.2 * untold["quays_fast_share"]
    assert told["ships_slow_share"] < untold["ships_slow_share"] + 0.01
