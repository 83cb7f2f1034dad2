import pytest

from twinscrew.hil_sim.bench import harbour


@pytest.mark.slow
def test_with_the_outline_quays_stand_and_ships_are_as_fast_as_without(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(harbour, "PASSAGES", 2)
    figures = harbour.run()["harbour"]
    told, untold = figures["tracker"], figures["without_outline"]
    assert told["quays_fast_share"] < 0.2 * untold["quays_fast_share"]
    assert told["ships_slow_share"] < untold["ships_slow_share"] + 0.01
