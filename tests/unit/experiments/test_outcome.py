from tests.unit.experiments.episodes import vessel

from twinscrew.hil_sim.experiments.episode import cause


def test_the_cause_is_that_of_the_first_failure() -> None:
    late = vessel("timeout", 90.0)
    buoy = vessel("collision", 12.0, "buoy")
    two = vessel("collision", 15.0, "vessel")
    assert cause((vessel(), vessel())) is None
    assert cause((late, vessel())) == "time"
    assert cause((late, two, buoy, two)) == "buoy"
    assert cause((two, late, two)) == "vessel"
