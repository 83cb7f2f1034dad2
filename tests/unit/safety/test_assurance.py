import numpy as np
import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Float64, HealthEvent, Odometry, Severity, Tracks
from twinscrew.runtime.safety.assurance import Assurance, AssuranceSettings
from twinscrew.runtime.safety.guard import ThrustLimits
from twinscrew.runtime.settings import convert

ON = AssuranceSettings(enabled=True)
AHEAD = np.array([1000.0, 1000.0])
SCAN_NS = 100_000_000


def odometry(scan: int = 0, surge: float = 3.0, yaw_rate: float = 0.0) -> Odometry:
    return Odometry(
        stamp_ns=scan * SCAN_NS,
        position_N=np.zeros(3),
        q_NB=quaternion_from_euler(0.0, 0.0, 0.0),
        velocity_B=np.array([surge, 0.0, 0.0]),
        rates_B=np.array([0.0, 0.0, yaw_rate]),
    )


def tracks(scan: int, *rows: tuple[float, float, float, float, float]) -> Tracks:
    """North, east, their rates, and the radius of each."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return Tracks(
        stamp_ns=scan * SCAN_NS,
        id=np.arange(len(table)),
        p_N=table[:, :2],
        v_N=table[:, 2:4],
        radius=table[:, 4],
        covariance=np.zeros((len(table), 4, 4)),
        age_s=np.zeros(len(table)),
    )


def buoy(distance: float, east: float = 0.0) -> tuple[float, float, float, float, float]:
    """A buoy with this much open water between it and our bow."""
    return (distance + 2.8 + 1.0, east, 0.0, 0.0, 1.0)


def steps(
    assurance: Assurance,
    *rows: tuple[float, float, float, float, float],
    scans: int = 2,
    surge: float = 3.0,
    command: Float64 = AHEAD,
) -> tuple[Float64, list[HealthEvent]]:
    """Let scans pass in which nothing changes, the first and each fifth with a decision."""
    thrust, events = command, []
    for scan in range(scans):
        seen = tracks(scan, *rows)
        wanted = command if scan % 5 == 0 else thrust
        thrust, said = assurance.step(
            odometry(scan, surge), seen, thrust, wanted, decided=scan % 5 == 0
        )
        events += said
    return thrust, events


def test_in_open_water_the_command_passes_untouched():
    assurance = Assurance(ON)
    assert steps(assurance)[0] is AHEAD
    assert steps(assurance, buoy(30.0))[0] is AHEAD


def test_a_buoy_that_can_still_be_avoided_later_is_left_to_the_policy():
    thrust, events = steps(Assurance(ON), buoy(8.0))
    assert thrust is AHEAD
    assert not events


def test_in_time_to_stop_short_of_the_buoy_it_brakes_no_faster_than_propellers_turn():
    thrust, events = steps(Assurance(ON), buoy(4.0))
    assert thrust.tolist() == [900.0, 900.0]
    (event,) = events
    assert (event.name, event.severity) == ("assurance_intervened", Severity.WARNING)
    assert event.detail.startswith("brake: the command meets track 0 in 1.")


def test_switched_off_it_lets_everything_pass():
    thrust, events = steps(Assurance(AssuranceSettings(enabled=False)), buoy(3.0))
    assert thrust is AHEAD
    assert not events


@pytest.mark.parametrize(("side", "turn"), [(1.0, [900.0, 1000.0]), (-1.0, [1000.0, 900.0])])
def test_where_braking_does_not_help_it_turns_away_from_the_threat(side, turn):
    crossing = (6.0, 7.0 * side, -2.0, -1.0 * side, 2.8)
    farsighted = AssuranceSettings(
        moving_horizon_s=4.0, clearance_m=0.0, margin_m=0.5, approach_per_s=1.0
    )
    thrust, (told,) = steps(Assurance(farsighted), crossing)
    assert told.detail.startswith("turn away")
    assert thrust.tolist() == turn


@pytest.mark.parametrize(
    ("north", "manoeuvre", "sign"), [(9.0, "full astern", -1), (-8.0, "full ahead", 1)]
)
def test_lying_in_the_way_of_another_it_makes_way(north, manoeuvre, sign):
    coming = (north, 0.0, -north / 3.0, 0.0, 2.8)  # there in a second
    thrust, (told,) = steps(Assurance(ON), coming, surge=0.0, command=np.zeros(2))
    assert told.detail.startswith(manoeuvre)
    assert thrust.tolist() == [sign * 100.0] * 2


def test_thrust_stays_within_the_propellers_range():
    limits = ThrustLimits(min_n=-300.0, max_n=1000.0)
    thrust, _ = steps(Assurance(ON, limits), buoy(4.0), scans=40)
    assert thrust.tolist() == [-300.0, -300.0]


def test_a_manoeuvre_is_told_once_and_goes_on_until_the_policy_has_news():
    assurance = Assurance(ON)
    _, events = steps(assurance, buoy(4.0), scans=4)
    assert [event.name for event in events] == ["assurance_intervened"]
    held = np.array([0.0, 0.0])
    going_on, said = assurance.step(
        odometry(4, 0.5), tracks(4, buoy(4.0)), held, held, decided=False
    )
    assert going_on.tolist() == [-100.0, -100.0]
    assert not said


def test_the_policy_gets_the_propellers_back_when_its_command_is_safe():
    assurance = Assurance(ON)
    steps(assurance, buoy(4.0), scans=4)
    astern = np.array([-200.0, -200.0])
    thrust, events = assurance.step(
        odometry(5, 0.2), tracks(5, buoy(4.0)), astern, astern, decided=True
    )
    assert thrust is astern
    (event,) = events
    assert (event.name, event.severity) == ("assurance_released", Severity.INFO)
    assert event.detail == "after 0.5 s"


def test_a_contact_that_no_manoeuvre_makes_gentler_is_no_reason_to_override():
    angles = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    ring = [
        (8 * c, 8 * s, -2 * c, -2 * s, 2.8)
        for c, s in np.column_stack([np.cos(angles), np.sin(angles)])
    ]
    thrust, events = steps(Assurance(ON), *ring, surge=0.0, command=np.zeros(2))
    assert thrust.tolist() == [0.0, 0.0]
    assert not events


def test_an_unavoidable_contact_is_made_gentler():
    thrust, events = steps(Assurance(ON), buoy(0.6), scans=3)
    assert thrust.sum() < 2000.0
    assert [event.name for event in events] == ["assurance_intervened"]


def test_lying_beside_a_buoy_is_allowed_and_leaving_it_too():
    for surge, command in ((0.0, np.zeros(2)), (-0.5, np.array([-200.0, -200.0]))):
        thrust, events = steps(Assurance(ON), buoy(0.1), surge=surge, command=command)
        assert thrust is command
        assert not events


def test_forgetting_ends_a_manoeuvre_without_a_word():
    assurance = Assurance(ON)
    steps(assurance, buoy(4.0))
    assurance.reset()
    thrust, events = assurance.step(odometry(9), tracks(9), AHEAD, AHEAD, decided=False)
    assert thrust is AHEAD
    assert not events


def test_time_that_goes_back_or_jumps_turns_no_propeller_faster():
    assurance = Assurance(ON)
    steps(assurance, buoy(4.0), scans=3)
    back, _ = assurance.step(odometry(0), tracks(0, buoy(4.0)), AHEAD, AHEAD, decided=False)
    assert back.tolist() == AHEAD.tolist()
    late, _ = assurance.step(odometry(500), tracks(500, buoy(4.0)), AHEAD, AHEAD, decided=False)
    assert late.min() >= 0.0  # a second's worth at most


@pytest.mark.parametrize("wrong", [{"horizon_s": 0.0}, {"margin_m": -1.0}, {"enable": True}])
def test_settings_that_cannot_be_are_refused(wrong):
    with pytest.raises(ConfigError):
        convert(wrong, AssuranceSettings)
