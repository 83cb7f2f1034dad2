import numpy as np
import pytest

from twinscrew.hil_sim.experiments.episode import WitnessAssurance
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sea.sea import SeaSettings, WaveSettings, WindSettings
from twinscrew.hil_sim.supervisor import Outcome, Supervisor
from twinscrew.hil_sim.world import Touched, World
from twinscrew.runtime.messages.types import Odometry, Tracks
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.vessel_description import load_vessel

CALM = SeaSettings(waves=WaveSettings(gain=0.0), wind=WindSettings(mean_mps=0.0))
AHEAD = "[[vessel]]\nstart_m = [0, 0]\nheading_deg = 0\ngoal_m = [40, 0]\n"


def sailed(tmp_path, rest: str, commands) -> tuple[list[Touched | None], Supervisor]:
    file = tmp_path / "scenario.toml"
    file.write_text("time_limit_s = 20\n" + AHEAD + rest)
    scenario = load_scenario(file)
    world = World(scenario, load_sensor("vrx32"), load_vessel(), CALM, 0)
    supervisor = Supervisor(world)
    while not supervisor.over:
        supervisor.advance(0.1, np.array(commands, dtype=float))
    return [result.touched for result in supervisor.results()], supervisor


def test_a_vessel_that_hits_a_buoy_says_so(tmp_path) -> None:
    rest = "[[buoy]]\ncentre_m = [12, 0]\n"
    touched, supervisor = sailed(tmp_path, rest, [[800, 800]])
    assert supervisor.outcomes == [Outcome.COLLISION]
    assert touched == ["buoy"]


def test_two_vessels_that_hit_each_other_both_say_so(tmp_path) -> None:
    rest = "[[vessel]]\nstart_m = [20, 0]\nheading_deg = 180\ngoal_m = [-30, 0]\n"
    touched, supervisor = sailed(tmp_path, rest, [[800, 800], [800, 800]])
    assert supervisor.outcomes == [Outcome.COLLISION] * 2
    assert touched == ["vessel", "vessel"]


def test_a_vessel_that_hits_a_quay_says_so(tmp_path) -> None:
    rest = "[[quay]]\ncentre_m = [15, 0]\nsize_m = [4, 20, 1.5]\n"
    touched, _ = sailed(tmp_path, rest, [[800, 800]])
    assert touched == ["quay"]


@pytest.mark.parametrize("thrust", [0, 800])
def test_who_touches_nothing_has_nothing_to_say(tmp_path, thrust: float) -> None:
    touched, supervisor = sailed(tmp_path, "", [[thrust, thrust]])
    assert supervisor.outcomes == [Outcome.GOAL if thrust else Outcome.TIMEOUT]
    assert touched == [None]


def test_an_assurance_remembers_how_often_it_stepped_in() -> None:
    assurance = WitnessAssurance()
    thrust, done = np.full(2, 1000.0), {"decided": True}
    for k, distance in enumerate((40.0, 8.0, 7.5, 40.0, 8.0)):
        tracks = buoy_ahead(distance, stamp_ns=k * 500_000_000)
        assurance.step(full_ahead(tracks.stamp_ns), tracks, thrust, thrust, **done)
    assert assurance.interventions == 2


def full_ahead(stamp_ns: int) -> Odometry:
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=np.zeros(3),
        q_NB=np.array([1.0, 0.0, 0.0, 0.0]),
        velocity_B=np.array([3.0, 0.0, 0.0]),
        rates_B=np.zeros(3),
    )


def buoy_ahead(distance: float, stamp_ns: int) -> Tracks:
    return Tracks(
        stamp_ns=stamp_ns,
        id=np.array([1]),
        p_N=np.array([[distance, 0.0]]),
        v_N=np.zeros((1, 2)),
        radius=np.array([0.75]),
        covariance=np.zeros((1, 4, 4)),
        age_s=np.array([5.0]),
    )
