"""Trials, sailed by the simulator's vessels: what they do, where they stay, and what ends them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from tests.harness.boat import cloud, make_pipeline, stamp

from twinscrew.hil_sim.sea.sea import Sea, SeaSettings, WaveSettings, WindSettings
from twinscrew.hil_sim.vessel.dynamics import VesselDynamics
from twinscrew.hil_sim.vessel.rest import at_rest
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import rotation_from_quaternion
from twinscrew.runtime.messages.types import Goal, Odometry, Tracks
from twinscrew.runtime.safety.guard import ThrustLimits
from twinscrew.runtime.vessel.trial import TRIALS, Trial, TrialSettings, room_m
from twinscrew.runtime.vessel_description import load_vessel

SCAN_S, STEP_S = 0.1, 0.05


def tracks(*rows: tuple[float, float, float, float], time_s: float = 0.0) -> Tracks:
    """Tracks of 1 m: north, east [m], and their velocities."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    count = len(table)
    return Tracks(
        stamp_ns=stamp(time_s),
        id=np.arange(count),
        p_N=table[:, :2],
        v_N=table[:, 2:],
        radius=np.ones(count),
        covariance=np.tile(np.eye(4), (count, 1, 1)),
        age_s=np.zeros(count),
    )


class Water:
    """A vessel on the simulator's water, whose thrust a trial gives."""

    def __init__(
        self, name: str = "wam_v", *, wind_mps: float = 0.0, current: tuple[float, float] = (0, 0)
    ) -> None:
        self.vessel = load_vessel(name)
        thrusters = self.vessel.thrusters
        self.limits = ThrustLimits(min_n=thrusters.min_n, max_n=thrusters.max_n)
        self.dynamics = VesselDynamics(self.vessel)
        settings = SeaSettings(
            waves=WaveSettings(gain=0.0),
            wind=WindSettings(mean_mps=wind_mps),
            current_mps=(float(current[0]), float(current[1])),
        )
        self.sea = Sea(settings, np.random.default_rng(0))
        self.state = at_rest(self.dynamics, np.zeros((1, 2)), np.zeros(1))
        self.time_s = 0.0
        self.places: list[np.ndarray] = []
        self.surges: list[float] = []
        self.thrusts: list[np.ndarray] = []
        self.events: list[str] = []
        self.details: list[str] = []

    def trial(self, name: str, **settings: object) -> Trial:
        given = {"around_m": room_m(name, self.vessel)} | settings
        return Trial(TrialSettings(name=name, **given), self.vessel, self.limits)  # type: ignore[arg-type]

    def odometry(self) -> Odometry:
        state = self.state
        return Odometry(
            stamp_ns=stamp(self.time_s),
            position_N=state.position_N[0],
            q_NB=state.q_NB[0],
            velocity_B=state.velocity_B[0],
            rates_B=state.rates_B[0],
        )

    def sail(self, trial: Trial, until_s: float = 600.0, around: Tracks | None = None) -> None:
        """Let the trial drive until it has ended, and a time at the latest."""
        end_s = self.time_s + until_s
        while not trial.has_ended and self.time_s < end_s - 1e-6:
            thrust, events = trial.step(self.odometry(), around or tracks())
            self.events += [event.name for event in events]
            self.details += [event.detail for event in events]
            self.thrusts.append(thrust)
            for _ in range(round(SCAN_S / STEP_S)):
                self.state = self.dynamics.step(
                    self.state, thrust[None], self.sea, self.time_s, STEP_S
                )
                self.time_s += STEP_S
            self.places.append(self.state.position_N[0, :2].copy())
            self.surges.append(float(self.state.velocity_B[0, 0]))

    @property
    def farthest_m(self) -> float:
        return float(np.abs(np.array(self.places)).max())


@pytest.mark.parametrize(
    ("name", "hull"), [*((name, "blueboat") for name in TRIALS), ("straight", "heron")]
)
def test_a_trial_is_sailed_to_its_end_within_its_box_in_the_papers_wind(
    name: str, hull: str
) -> None:
    water = Water(hull, wind_mps=10.0)
    trial = water.trial(name)
    water.sail(trial)
    assert trial.done
    assert trial.outcome == water.events[-1] == "trial_done"
    assert water.farthest_m <= trial.needed_m
    limits = water.limits
    assert np.all(
        (np.array(water.thrusts) >= limits.min_n) & (np.array(water.thrusts) <= limits.max_n)
    )


def test_straight_runs_go_to_the_top_speed_ahead_and_as_far_astern() -> None:
    water = Water()
    water.sail(water.trial("straight"))
    assert max(water.surges) > 0.95 * water.vessel.top_speed_mps
    assert min(water.surges) < -0.5 * water.vessel.top_speed_mps
    asked = {round(float(pair.mean()), -1) for pair in water.thrusts if abs(pair[0] - pair[1]) < 5}
    assert {250.0, 500.0, 750.0, 1000.0, -250.0, -500.0} <= asked


def test_a_zigzag_changes_the_heading_by_as_much_as_its_name_says_to_both_sides() -> None:
    water = Water()
    trial = water.trial("zigzag")
    sides: list[float] = []
    while not trial.has_ended:
        before = len(water.thrusts)
        water.sail(trial, SCAN_S)
        if len(water.thrusts) > before and "zig-zag 20/20" in trial.words:
            left, right = water.thrusts[-1]
            if (left + right) / 2 == pytest.approx(500.0):
                sides.append(round(float(left - right)))
    switches = sum(a * b < 0 for a, b in pairwise(sides) if abs(a) == 600)
    assert switches >= 4
    assert {600, -600} <= set(sides)


def test_circles_turn_more_than_once_round_both_ways() -> None:
    water = Water()
    trial = water.trial("circle")
    turned: dict[str, float] = {}
    while not trial.has_ended:
        water.sail(trial, SCAN_S)
        turned.setdefault(trial.words, 0.0)
        turned[trial.words] += float(water.state.rates_B[0, 2]) * SCAN_S
    circles = {words: angle for words, angle in turned.items() if "manoeuvre: circle" in words}
    assert len(circles) == 4
    assert all(abs(angle) > 2 * np.pi for angle in circles.values())
    assert all((angle > 0) == ("starboard" in words) for words, angle in circles.items())


def test_a_crash_stop_goes_full_astern_from_full_speed_until_the_boat_stands() -> None:
    water = Water()
    water.sail(water.trial("stop"))
    at = int(np.argmax([pair.max() <= -400.0 for pair in water.thrusts]))
    assert water.surges[at - 1] > 0.9 * water.vessel.top_speed_mps
    assert min(water.surges[at : at + 60]) < 0.1


def test_without_room_it_is_refused_and_says_how_much_it_needs() -> None:
    water = Water()
    needed = room_m("straight", water.vessel)
    with pytest.raises(ConfigError, match=rf"trial\.around_m: .*{needed:.0f} m"):
        water.trial("straight", around_m=0.0)
    with pytest.raises(ConfigError, match=r"trial\.around_m: .*got 10 m"):
        water.trial("straight", around_m=10.0)
    with pytest.raises(ConfigError, match=r"trial\.box_m: .*got 10 m"):
        water.trial("straight", box_m=(-10.0, -100.0, 10.0, 100.0))
    with pytest.raises(ValueError, match="south < north"):
        TrialSettings(name="straight", box_m=(10.0, -100.0, -10.0, 100.0))


def test_outside_its_box_or_beside_a_track_it_does_not_begin() -> None:
    water = Water()
    away = water.trial("stop", box_m=(200.0, 200.0, 400.0, 400.0))
    water.sail(away)
    assert (away.outcome, away.done) == ("trial_refused", False)
    beside = water.trial("stop")
    water.sail(beside, around=tracks((8.0, 0.0, 0.0, 0.0)))
    assert beside.outcome == "trial_refused"
    assert not np.any(water.thrusts)


@pytest.mark.parametrize(
    ("row", "ends"),
    [((60.0, 0.0, 0.0, 0.0), False), ((30.0, 0.0, -6.0, 0.0), True), ((16.0, 0.0, 0.0, 0.0), True)],
    ids=["far", "coming", "near"],
)
def test_a_track_that_comes_near_ends_it_and_the_boat_brakes(
    row: tuple[float, float, float, float], ends: bool
) -> None:
    water = Water()
    trial = water.trial("straight")
    water.sail(trial, 5.0)
    before = water.surges[-1]
    assert before > 1.0
    place = water.places[-1]
    water.sail(trial, 0.3, tracks((row[0] + place[0], row[1] + place[1], *row[2:])))
    assert (trial.outcome == "trial_track_near") is ends
    if ends:
        assert water.thrusts[-1].max() < 0.0
        water.sail(trial, 20.0)
        assert trial.has_ended
        assert abs(water.surges[-1]) < 0.3 * before


def test_carried_out_of_its_box_by_a_current_it_ends() -> None:
    water = Water(current=(0.0, 2.5))
    trial = water.trial("straight", around_m=room_m("straight", water.vessel))
    water.sail(trial)
    assert trial.outcome == "trial_out_of_box"
    assert np.abs(water.places[-1]).max() < trial.needed_m + 25.0


def test_a_speed_limit_lowers_the_thrust_and_ends_the_trial_where_it_is_passed() -> None:
    slow = Water()
    trial = slow.trial("straight", speed_limit_mps=2.0)
    slow.sail(trial)
    assert trial.done
    assert 1.2 < max(slow.surges) < 2.0
    swept = Water(current=(1.9, 0.0))
    trial = swept.trial("straight", speed_limit_mps=2.0)
    swept.sail(trial)
    assert trial.outcome == "trial_too_fast"


def test_after_its_time_it_is_done_and_the_boat_at_rest() -> None:
    water = Water()
    trial = water.trial("all", max_time_s=30.0)
    water.sail(trial)
    assert trial.done
    assert water.time_s < 45.0
    assert abs(water.surges[-1]) < 0.5


def test_in_a_pipeline_it_ends_when_somebody_else_drives_or_an_order_comes() -> None:
    def begun() -> tuple[object, Water, Trial]:
        water = Water()
        trial = water.trial("straight")
        pipeline = make_pipeline(trial)  # type: ignore[arg-type]
        for step in range(12):
            water.time_s = 0.1 * step
            decision, _ = pipeline.step(cloud(water.time_s), water.odometry(), engaged=True)
        assert np.any(decision.thrust)
        assert pipeline.has_task
        return pipeline, water, trial

    for engaged, order in ((False, False), (True, True)):
        pipeline, water, trial = begun()
        if order:
            place = np.array([9.0, 9.0])
            pipeline.mission.set_goal(Goal(stamp_ns=stamp(1.2), position_N=place))
        water.time_s = 1.3
        decision, _ = pipeline.step(cloud(1.3), water.odometry(), engaged=engaged)
        assert [e.name for e in decision.events] == ["trial_interrupted"]
        assert not np.any(decision.thrust)
        assert not pipeline.has_task
        assert trial.outcome == "trial_interrupted"


def test_the_frame_of_the_harness_is_the_runtimes() -> None:
    """A turn to starboard is a positive one, or all of the above would mean nothing."""
    water = Water()
    trial = water.trial("circle")
    water.sail(trial, 6.0)
    assert "starboard" in trial.words
    R_NB = rotation_from_quaternion(water.state.q_NB[0])
    assert R_NB[1, 0] > 0.0
