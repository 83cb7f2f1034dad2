"""Odometry from the autopilot, in the LiDAR's time, and from GPS and IMU."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.harness.boat import EPOCH_NS, SECOND, Steady, cloud, feed, make_pipeline
from tests.harness.boat import odometry as odometry_at
from tests.harness.circling import DT_S, Circling

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.telemetry import Origin
from twinscrew.runtime.datum import EARTH_RADIUS_M, Datum
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.estimation.estimator import EstimationSettings
from twinscrew.runtime.estimation.inertial import InertialFilter
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import as_read_back
from twinscrew.runtime.messages.types import Odometry
from twinscrew.runtime.vessel.config import RuntimeConfig, autopilot_of, inputs_of
from twinscrew.runtime.vessel.inputs import ANOTHER_CLOCK_NS, WINDOW, Alignment, AlignmentSettings
from twinscrew.runtime.vessel.outputs import Outputs
from twinscrew.runtime.vessel.vessel import Vessel, make_vessel

MS = SECOND // 1000
ORIGIN = Origin(latitude_deg=-33.0, longitude_deg=151.0)
"""Where the simulated autopilot counts from."""


def after_scans(alignment: Alignment, delays_ms, period_s: float = 0.1) -> Alignment:
    """Let scans come, each so long after its stamp; the clocks differ by EPOCH_NS."""
    for k, delay_ms in enumerate(delays_ms):
        taken_s = 50.0 + k * period_s
        stamp_ns = EPOCH_NS + round(taken_s * SECOND)
        alignment.scan_came(stamp_ns, taken_s + delay_ms * 1e-3)
    return alignment


def error_ms(alignment: Alignment) -> float:
    """How much too late a time of the loop is in the LiDAR's clock."""
    return (alignment.lidar_ns(0) - EPOCH_NS) / MS


def test_before_the_first_scan_nothing_is_known() -> None:
    assert Alignment().lidar_ns(0) is None


def test_the_difference_of_the_clocks_is_found_up_to_the_usual_latency() -> None:
    delays = [5.0, 6.0, 7.0] * 10
    assert error_ms(after_scans(Alignment(), delays)) == pytest.approx(-6.0, abs=1e-3)


def test_a_latency_that_is_known_is_taken_out() -> None:
    alignment = Alignment(AlignmentSettings(lidar_latency_s=0.006))
    assert error_ms(after_scans(alignment, [5.0, 6.0, 7.0] * 10)) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("odd_ms", [-900.0, -500.0, 500.0, 900.0])
def test_a_scan_that_is_late_or_wrongly_stamped_moves_nothing(odd_ms: float) -> None:
    delays = [5.0] * 10 + [odd_ms] + [5.0] * 3
    assert error_ms(after_scans(Alignment(), delays)) == pytest.approx(-5.0, abs=1e-3)


@given(st.lists(st.floats(0.0, 400.0), min_size=1, max_size=2 * WINDOW))
def test_the_error_is_never_more_than_the_worst_latency(delays: list[float]) -> None:
    assert -max(delays) - 1e-3 <= error_ms(after_scans(Alignment(), delays)) <= 1e-3


def test_a_drifting_clock_is_followed() -> None:
    alignment = Alignment()
    drift = 100e-6
    for k in range(20_000):
        taken_s = k * 0.1
        alignment.scan_came(EPOCH_NS + round(taken_s * (1 + drift) * SECOND), taken_s)
    assert error_ms(alignment) == pytest.approx(2000 * drift * 1000, abs=1.0)


@pytest.mark.parametrize("set_by_ns", [-3600 * SECOND, 3600 * SECOND])
def test_after_a_clock_was_set_the_next_scan_counts(set_by_ns: int) -> None:
    alignment = after_scans(Alignment(), [5.0] * 50)
    assert abs(set_by_ns) > ANOTHER_CLOCK_NS
    alignment.scan_came(EPOCH_NS + set_by_ns + 100 * SECOND, 100.0)
    assert alignment.lidar_ns(0) == EPOCH_NS + set_by_ns


def test_stamps_of_the_systems_clock_need_no_guess() -> None:
    settings = AlignmentSettings(lidar_clock="system")
    alignment = Alignment(settings, wall_ns=lambda: EPOCH_NS + 70 * SECOND)
    alignment.scan_came(EPOCH_NS + 69 * SECOND, 70.0)
    assert alignment.lidar_ns(0) == EPOCH_NS


class Sailing:
    """A vessel whose odometry comes from its autopilot, without sockets."""

    def __init__(self, lidar_begin_ns: int = EPOCH_NS, datum: Datum | None = None) -> None:
        self.lidar_begin_ns = lidar_begin_ns
        settings = AutopilotSettings(state_hz=20.0, arm=True, receiver_fitted=False, datum=datum)
        pipeline = make_pipeline(Steady())
        self.vessel = Vessel(pipeline, AutopilotLink(settings), alignment=Alignment())
        self.pilot = RoverAutopilot(RoverAutopilotSettings(), 1, ORIGIN)
        self.now_s: float | None = None
        self.fed = []
        self.errors_s: list[tuple[float, float]] = []
        self.decisions = []
        self.events = []

    def sail_slowly(self, seconds: float, rate: float) -> "Sailing":
        """The same in a simulation of 10 ms steps, whose time passes at a rate below one."""
        said, scan_s, fed = b"", 0.0, 0
        for k in range(round(seconds / 0.01)):
            now_s, true_s = k * 0.01, k * 0.01 * rate
            self.now_s = true_s
            if true_s >= scan_s:
                scan_s += 0.1
                self.scan(self.lidar_begin_ns + round(true_s * SECOND), now_s)
            said += self.pilot.step(true_s, odometry_at(true_s, north=2.0 * true_s))
            if k % 5 == 0:
                self.tick(said, now_s)
                said = b""
            for odometry in self.fed[fed:]:
                stamp_s = (odometry.stamp_ns - self.lidar_begin_ns) / SECOND
                self.errors_s.append((now_s, stamp_s - odometry.position_N[0] / 2.0))
            fed = len(self.fed)
        return self

    def sail(self, seconds: float) -> "Sailing":
        """A boat that goes north with 2 m/s."""
        for k in range(round(seconds / 0.05)):
            now_s = round(k * 0.05, 6)
            if k % 2 == 0:
                self.scan(self.lidar_begin_ns + round(now_s * SECOND), now_s)
            true = odometry_at(now_s, north=2.0 * now_s)
            self.tick(self.pilot.step(now_s, true), now_s)
        return self

    def scan(self, stamp_ns: int, now_s: float) -> None:
        scan = cdr.encode_point_cloud(cloud((stamp_ns - EPOCH_NS) / SECOND))
        self._note(feed(self.vessel, "points", scan, now_s), now_s)

    def tick(self, said: bytes, now_s: float) -> None:
        self._note(self.vessel.receive(said, now_s), now_s)
        self._note(self.vessel.tick(now_s), now_s)

    def _note(self, out: Outputs, now_s: float) -> None:
        self.pilot.receive(out.autopilot, now_s if self.now_s is None else self.now_s)
        self.fed += [taken.message for taken in out.messages if taken.topic == "odometry"]
        self.decisions += [out.decision] if out.decision else []
        self.events += out.events


@pytest.mark.parametrize("begin_s", [0, -1_000_000, 1_000_000])
def test_what_is_fed_has_the_lidars_stamps_whatever_its_clock_says(begin_s: int) -> None:
    begin_ns = EPOCH_NS + begin_s * SECOND
    boat = Sailing(begin_ns).sail(5.0)
    assert len(boat.fed) > 50
    for odometry in boat.fed:
        time_s = (odometry.stamp_ns - begin_ns) / SECOND
        assert odometry.position_N[0] == pytest.approx(2.0 * time_s, abs=0.01)


def test_scans_are_decided_on_and_the_boat_may_drive() -> None:
    boat = Sailing().sail(4.0)
    assert len(boat.decisions) > 20
    assert boat.vessel.engaged


@pytest.mark.parametrize("rate", [1.0, 0.95, 0.7, 0.5])
def test_a_simulation_slower_than_real_time_sails_on_its_autopilots_odometry(rate: float) -> None:
    boat = Sailing().sail_slowly(40.0, rate)
    assert boat.vessel.engaged
    worst_s = max(abs(error_s) for now_s, error_s in boat.errors_s if now_s > 15.0)
    assert worst_s < 0.1
    settled_ns = EPOCH_NS + round(15.0 * rate * SECOND)
    names = ("odometry_missing", "input_late", "odometry_stale", "lidar_stale")
    assert not [e for e in boat.events if e.name in names and e.stamp_ns > settled_ns]


def test_with_a_datum_the_link_asks_for_the_autopilots_origin_and_counts_from_the_datum() -> None:
    south_deg = math.degrees(50.0 / EARTH_RADIUS_M)
    datum = Datum(latitude_deg=ORIGIN.latitude_deg - south_deg, longitude_deg=151.0)
    boat = Sailing(datum=datum).sail(4.0)
    assert len(boat.fed) > 30
    for odometry in boat.fed:
        time_s = (odometry.stamp_ns - EPOCH_NS) / SECOND
        assert odometry.position_N[0] == pytest.approx(50.0 + 2.0 * time_s, abs=0.02)


def test_an_autopilot_that_falls_silent_is_stale_odometry() -> None:
    boat = Sailing().sail(4.0)
    boat.pilot.step = lambda now_s, true: b""
    for k in range(20):
        boat.tick(b"", 4.0 + k * 0.05)
    assert "odometry_stale" in [event.name for event in boat.events]
    assert not boat.vessel.engaged


def test_scans_of_the_last_second_that_a_stamp_can_say_stop_the_boat_and_not_the_run() -> None:
    end_ns = 2**31 * SECOND
    boat = Sailing(end_ns - 5 * SECOND).sail(4.9)
    assert boat.vessel.engaged
    for k in range(40):
        now_s = 5.0 + k * 0.05
        boat.scan(end_ns - SECOND + k, now_s)
        boat.tick(boat.pilot.step(now_s, odometry_at(now_s)), now_s)
    assert any(e.name == "bad_message" and "is not a stamp" in e.detail for e in boat.events)
    assert not boat.vessel.engaged


def test_from_the_bus_nothing_of_the_autopilots_is_taken() -> None:
    assert not make_vessel(RuntimeConfig(policy="apf")).follows_autopilot
    assert "odometry" in inputs_of(RuntimeConfig())


def test_the_configuration_chooses_the_source_and_asks_for_it() -> None:
    config = RuntimeConfig(odometry_source="autopilot", policy="apf")
    assert make_vessel(config).follows_autopilot
    assert autopilot_of(config).state_hz == 20.0
    assert "odometry" not in inputs_of(config)
    assert "gps" not in inputs_of(config)


def test_a_rate_that_is_configured_is_kept() -> None:
    link = AutopilotSettings(state_hz=50.0)
    assert autopilot_of(RuntimeConfig(odometry_source="autopilot", autopilot=link)) is link


def test_positions_do_not_move_when_they_are_encoded() -> None:
    boat = Sailing().sail(1.0)
    steps = np.diff([odometry.position_N[0] for odometry in boat.fed])
    assert steps == pytest.approx([0.1] * len(steps), abs=1e-5)


@given(
    st.tuples(*[st.floats(-1e4, 1e4)] * 3),
    st.tuples(*[st.floats(-math.pi, math.pi)] * 3),
    st.tuples(*[st.floats(-20.0, 20.0)] * 6),
)
def test_own_odometry_is_taken_in_to_the_last_bit_as_a_replay_reads_it(
    position, angles, motion
) -> None:
    made = Odometry(
        stamp_ns=EPOCH_NS,
        position_N=np.array(position),
        q_NB=quaternion_from_euler(*angles),
        velocity_B=np.array(motion[:3]),
        rates_B=np.array(motion[3:]),
    )
    taken, read = as_read_back(made), cdr.decode_odometry(cdr.encode_odometry(made))
    for name in ("position_N", "q_NB", "velocity_B", "rates_B"):
        assert getattr(taken, name).tobytes() == getattr(read, name).tobytes()


def test_own_odometry_that_is_no_number_is_refused() -> None:
    with pytest.raises(MessageError, match="not finite"):
        as_read_back(odometry_at(0.0, north=math.nan))


class Estimating:
    """A vessel whose odometry is made of GPS and IMU."""

    def __init__(self) -> None:
        config = RuntimeConfig(odometry_source="gps_imu", sensor="vrx16", policy="apf")
        assert {"gps", "imu"} < set(inputs_of(config))
        assert "odometry" not in inputs_of(config)
        self.vessel = make_vessel(config)
        self.events: list[str] = []
        self.decisions = 0
        self.made = 0
        self.boat = Circling(settings=EstimationSettings())
        self.boat.spoil_imu = lambda imu, t: self.take("imu", cdr.encode_imu(imu), t)
        self.boat.spoil_fix = lambda fix, t: self.take("gps", cdr.encode_fix(fix), t)

    def take(self, topic: str, payload: bytes, now_s: float) -> None:
        self._note(feed(self.vessel, topic, payload, now_s))

    def sail(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.1)):
            self.boat.sail(0.1)
            now_s = self.boat._steps * DT_S
            self.take("points", cdr.encode_point_cloud(cloud(now_s)), now_s)
            self._note(self.vessel.tick(now_s))

    def _note(self, out: Outputs) -> None:
        self.events += [event.name for event in out.events]
        self.decisions += out.decision is not None
        self.made += sum(taken.topic == "odometry" for taken in out.messages)


def test_gps_and_imu_become_odometry() -> None:
    sailing = Estimating()
    sailing.sail(5.0)
    assert sailing.events.count("estimate_ready") == 1
    assert sailing.decisions > 25
    assert "odometry_stale" not in sailing.events
    assert sailing.made > 50


def test_without_the_imu_odometry_is_stale() -> None:
    sailing = Estimating()
    sailing.sail(3.0)
    sailing.boat.spoil_imu = lambda imu, t: None
    sailing.sail(1.0)
    assert "odometry_stale" in sailing.events


@pytest.mark.parametrize("topic", ["gps", "imu"])
def test_a_sensors_bytes_that_are_no_message_are_told_and_dropped(topic: str) -> None:
    sailing = Estimating()
    sailing.take(topic, b"nonsense", 1.0)
    assert sailing.events == ["bad_message"]


def test_sensors_that_nobody_asked_for_are_passed_over() -> None:
    out = feed(make_vessel(RuntimeConfig(policy="apf")), "imu", b"nonsense", 1.0)
    assert (out.decision, out.events) == (None, [])


def test_a_fault_of_the_estimation_stops_the_boat_and_not_the_loop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sailing = Estimating()
    sailing.sail(3.0)
    with monkeypatch.context() as patch:
        patch.setattr(InertialFilter, "predict", lambda *_, **__: 1 / 0)
        sailing.boat.sail(0.01)
    assert sailing.events[-1] == "internal_error"
    sailing.sail(3.0)
    assert sailing.events.count("estimate_ready") == 2
