"""Identification of vessels from recordings made here: the simulator's vessels on trial."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from tests.unit.runtime.vessel.test_trial import tracks

from twinscrew.hil_sim.identification.figure import draw
from twinscrew.hil_sim.identification.hulls import made_up, performance
from twinscrew.hil_sim.identification.identify import Identification, check, identify, table_of
from twinscrew.hil_sim.sea.sea import Sea, SeaSettings, WaveSettings, WindSettings
from twinscrew.hil_sim.vessel.dynamics import VesselDynamics
from twinscrew.hil_sim.vessel.rest import at_rest
from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.link.ardupilot.thrust import (
    PaddleSettings,
    fraction_from_thrust,
    thrust_from_fraction,
)
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Odometry
from twinscrew.runtime.recording.recorder import Recorder
from twinscrew.runtime.safety.guard import ThrustLimits
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.hull_settings import paddles
from twinscrew.runtime.vessel.trial import Trial, TrialSettings, room_m
from twinscrew.runtime.vessel_description import VesselDescription, describe, load_vessel

EPOCH_NS = 1_800_000_000_000_000_000
Change = Callable[[Odometry], Odometry]


def scale_of(vessel: VesselDescription) -> PaddleSettings:
    return convert(paddles(vessel), PaddleSettings)


def record(
    folder: Path,
    truth: VesselDescription,
    known: VesselDescription,
    *,
    seconds: float = 150.0,
    drive: Callable[[float], tuple[float, float]] | None = None,
    thrust: bool = True,
    change: Change = lambda odometry: odometry,
) -> Path:
    """Sail the trials of a boat that is `truth` and is taken for `known`, and record them."""
    waves, wind = WaveSettings(), WindSettings()
    sea = Sea(SeaSettings(waves=waves, wind=wind), np.random.default_rng(1))
    dynamics = VesselDynamics(truth)
    state = at_rest(dynamics, np.zeros((1, 2)), np.zeros(1))
    limits = ThrustLimits(min_n=known.thrusters.min_n, max_n=known.thrusters.max_n)
    settings = TrialSettings(name="all", around_m=1.5 * room_m("all", known), max_time_s=seconds)
    trial = Trial(settings, known, limits)
    recorder = Recorder(folder / "recording", "boat", {}, lossless=True)
    command = np.zeros(2)
    for step in range(round(seconds / 0.05)):
        now_s = 0.05 * step
        stamp_ns = EPOCH_NS + round(now_s * 1e9)
        odometry = Odometry(
            stamp_ns=stamp_ns,
            position_N=state.position_N[0],
            q_NB=state.q_NB[0],
            velocity_B=state.velocity_B[0],
            rates_B=state.rates_B[0],
        )
        recorder.record("odometry", cdr.encode_odometry(change(odometry)), stamp_ns)
        if step % 2 == 0:
            command = trial.step(odometry, tracks())[0] if drive is None else np.array(drive(now_s))
            for name, newtons in zip(("thrust_left", "thrust_right"), command, strict=True):
                if thrust:
                    recorder.record(name, cdr.encode_thrust(float(newtons)), stamp_ns)
        pushed = [
            thrust_from_fraction(fraction_from_thrust(float(n), scale_of(known)), scale_of(truth))
            for n in command
        ]
        for part in range(2):
            state = dynamics.step(state, np.array([pushed]), sea, now_s + 0.025 * part, 0.025)
    recorder.close()
    return folder


@pytest.fixture(scope="module")
def tried(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict, Path, Identification]:
    """A hull made up for the purpose: its recording, the truth, what is known, what is found."""
    folder = tmp_path_factory.mktemp("hull")
    truth, known, _ = made_up(4)
    file = folder / "known.toml"
    file.write_text(tomli_w.dumps({"vessel": known}))
    run = record(folder, describe(table_of(truth)), load_vessel(str(file)))
    return run, truth, file, identify([run], str(file))


@pytest.mark.slow
def test_a_hull_that_nobody_has_seen_is_found(tried) -> None:
    _, truth, _, found = tried
    real = describe(table_of(truth))
    is_so, seems = performance(real), performance(found.vessel)
    assert all(abs(error) < 0.05 for error in seems.errors(is_so).values()), seems.errors(is_so)
    assert found.validation.position_rmse_5s_m < 0.1 * real.length_m
    assert found.validation.position_rmse_5s_m < 0.5 * found.given.position_rmse_5s_m


@pytest.mark.slow
def test_the_result_is_a_vessels_file_that_sails_and_the_figure_is_drawn(tried) -> None:
    run, _, _, found = tried
    file = run / "identified.toml"
    file.write_text(tomli_w.dumps({"vessel": found.table}))
    vessel = load_vessel(str(file))
    assert vessel.thrusters.curve[0][0] == -1.0
    assert vessel.thrusters.curve[-1] == (1.0, vessel.thrusters.max_n)
    draw(found, run / "figure.png")
    assert (run / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (run / "figure.svg").read_text()[:1000]


@pytest.mark.slow
def test_the_object_says_what_was_found_and_what_the_trials_do_not_tell(tried) -> None:
    *_, found = tried
    told = json.loads(json.dumps(found.as_dict()))
    assert set(told["validation"]) == {
        "position_rmse_5s_m",
        "speed_rmse_mps",
        "yaw_rate_rmse_rad_s",
    }
    assert told["vessel"]["mass_kg"] == found.vessel.mass_kg
    assert all(e["low"] <= e["value"] <= e["high"] for e in told["estimates"].values())
    assert any("only by their ratio" in words for words in told["warnings"])


@pytest.mark.slow
def test_a_mass_that_is_twice_the_true_one_is_found_out(tried) -> None:
    run, truth, file, _ = tried
    wrong = run / "wrong.toml"
    known = load_vessel(str(file))
    table = {
        key: truth[key]
        for key in ("name", "length_m", "beam_m", "thruster_spacing_m", "top_speed_mps")
    }
    table |= {"mass_kg": 2.0 * known.mass_kg, "thrust_max_n": known.thrusters.max_n}
    wrong.write_text(tomli_w.dumps({"vessel": table | {"thrust_min_n": known.thrusters.min_n}}))
    found = identify([run], str(wrong))
    assert "mass" in found.contradiction
    assert found.given.position_rmse_5s_m > 1.5 * found.validation.position_rmse_5s_m
    good, words = check([run], str(wrong))
    assert not good
    assert f"mass_kg = {2.0 * known.mass_kg:g}" in words


@pytest.fixture(scope="module")
def heron() -> VesselDescription:
    return load_vessel("heron")


def test_a_recording_without_thrust_is_refused(tmp_path: Path, heron: VesselDescription) -> None:
    run = record(tmp_path, heron, heron, seconds=45.0, thrust=False)
    with pytest.raises(RecordingError, match="holds no thrust: thrust_left and thrust_right"):
        identify([run], heron)


@pytest.mark.parametrize(
    ("drive", "words"),
    [(lambda _: (15.0, 15.0), "thrust hardly changes"), (lambda _: (0.0, 0.0), "hardly changes")],
    ids=["steady", "adrift"],
)
def test_trials_without_excitation_are_refused(
    tmp_path: Path, heron: VesselDescription, drive, words: str
) -> None:
    run = record(tmp_path, heron, heron, seconds=45.0, drive=drive)
    with pytest.raises(RecordingError, match=words):
        identify([run], heron)


def test_odometry_in_another_frame_is_refused(tmp_path: Path, heron: VesselDescription) -> None:
    from dataclasses import replace

    from twinscrew.runtime.geometry import rotation_from_quaternion

    def in_the_worlds_frame(odometry: Odometry) -> Odometry:
        turned = rotation_from_quaternion(odometry.q_NB) @ odometry.velocity_B
        return replace(odometry, velocity_B=turned)

    def drive(now_s: float) -> tuple[float, float]:
        return (20.0, 5.0) if now_s % 20 < 10 else (5.0, 20.0)

    run = record(tmp_path, heron, heron, seconds=60.0, drive=drive, change=in_the_worlds_frame)
    with pytest.raises(RecordingError, match="in the world's frame"):
        identify([run], heron)


def test_a_recording_that_is_too_short_is_refused(tmp_path: Path, heron: VesselDescription) -> None:
    run = record(tmp_path, heron, heron, seconds=12.0)
    with pytest.raises(RecordingError, match="at least 40 s are needed"):
        identify([run], heron)
