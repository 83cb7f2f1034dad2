"""Odometry from GPS and IMU: where it starts, what it bears, when it gives up, what it says."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as with_settings
from tests.harness.circling import DATUM, EPOCH_NS, EXACT_GPS, FRAME, Circling, truth

from twinscrew.hil_sim.sensors.navigation import ImuSettings, ReceiverSettings
from twinscrew.runtime.datum import Place
from twinscrew.runtime.estimation.estimator import EstimationSettings, odometry
from twinscrew.runtime.estimation.sensors import AntennaSettings, ImuSample, SensorSettings
from twinscrew.runtime.geometry import euler_from_quaternion
from twinscrew.runtime.perception.sensor import Mount

NOISY_GPS = ReceiverSettings()
ELSEWHERE = SensorSettings(
    antenna=AntennaSettings(x_m=-2.0, y_m=1.0, z_m=3.0),
    imu=Mount(x_m=1.0, y_m=-0.7, z_m=0.4, roll_rad=0.1, pitch_rad=-0.2, yaw_rad=1.5),
)


def lasts(begin_s, end_s):
    """Take a sensor's messages away for a while."""
    return lambda message, time_s: None if begin_s <= time_s < end_s else message


@pytest.mark.slow
@pytest.mark.parametrize("place", [SensorSettings(), ELSEWHERE], ids=["VRX's", "elsewhere, turned"])
def test_exact_sensors_give_the_truth_wherever_they_sit(place):
    settings = EstimationSettings(datum=DATUM, sensors=place)
    boat = Circling(settings=settings, place=place).sail(20.0)
    position_m, velocity_mps = boat.worst(skip_s=10.0)
    assert position_m < 0.03
    assert velocity_mps < 0.03
    state, last = truth(20.0), boat.odometry[-1]
    np.testing.assert_allclose(
        euler_from_quaternion(last.q_NB), euler_from_quaternion(state.q_NB[0]), atol=0.01
    )
    np.testing.assert_allclose(last.rates_B, state.rates_B[0], atol=0.02)


def test_sensors_whose_place_is_not_known_are_wrong_by_their_arms():
    boat = Circling(place=ELSEWHERE).sail(10.0)
    assert boat.worst(skip_s=5.0)[0] > 1.0


def test_odometry_comes_at_its_rate_on_multiples_of_its_period():
    boat = Circling().sail(5.0)
    stamps_ns = np.array([odometry.stamp_ns for odometry in boat.odometry])
    assert (np.diff(stamps_ns) == 50_000_000).all()
    assert (stamps_ns % 50_000_000 == 0).all()


def test_odometry_waits_until_the_velocity_is_known():
    boat = Circling(imu=ImuSettings(), gps=NOISY_GPS).sail(3.0)
    begin_s = (boat.odometry[0].stamp_ns - EPOCH_NS) * 1e-9
    assert 0.3 < begin_s < 1.5
    position_m, velocity_mps = boat.worst()
    assert position_m < 1.5
    assert velocity_mps < 2.0


def test_down_counts_from_where_the_vessel_floated_at_the_first_fix():
    boat = Circling().sail(5.0)
    assert abs(boat.odometry[-1].position_N[2]) < 0.2  # rolling lifts the antenna


def test_without_a_datum_the_first_fix_is_the_origin():
    boat = Circling(settings=EstimationSettings()).sail(3.0)
    first = truth(0.05).position_N[0]
    north, east, _ = boat.odometry[-1].position_N - (truth(3.0).position_N[0] - first)
    assert abs(north) < 1.0  # the antenna's arm: the origin lies where the antenna was
    assert abs(east) < 1.0


@pytest.mark.slow
def test_noise_is_filtered_and_biases_are_learned():
    boat = Circling(imu=ImuSettings(), gps=NOISY_GPS).sail(60.0)
    p, v = (np.array(errors) for errors in zip(*boat.errors(skip_s=20.0), strict=True))
    assert np.sqrt((p[:, :2] ** 2).mean()) < 0.25  # the receiver's is 0.5 m
    assert np.sqrt((v[:, :2] ** 2).mean()) < 0.12
    gyro_bias = boat.estimator.inertial.x[9:12]
    np.testing.assert_allclose(gyro_bias, boat._imu.gyro.bias, atol=2e-3)


@pytest.mark.slow
def test_fixes_that_come_late_are_used_for_their_own_time():
    prompt = Circling().sail(15.0).worst(skip_s=8.0)
    late = Circling(delay_s=0.2).sail(15.0).worst(skip_s=8.0)
    assert late[0] < prompt[0] + 0.05  # at 2 m/s it would be off by 0.4 m otherwise
    assert late[1] < prompt[1] + 0.05


def test_a_fix_from_the_imus_future_waits_for_it():
    ahead = Circling(spoil_imu=lambda imu, t: replace(imu, stamp_ns=imu.stamp_ns - 100_000_000))
    ahead.sail(10.0)
    assert not ahead.named("gps_lost")
    late_by_ns = 100_000_000
    errors = [
        odometry.position_N
        - truth((odometry.stamp_ns - EPOCH_NS + late_by_ns) * 1e-9).position_N[0]
        for odometry in ahead.odometry[100:]
    ]
    # The fixes are right at their stamps; what the IMU tells belongs 0.1 s later.
    assert max(float(np.hypot(*e[:2])) for e in errors) < 0.35


@pytest.mark.slow
def test_while_fixes_are_missing_it_coasts_and_says_so_every_second():
    boat = Circling(imu=ImuSettings(), gps=NOISY_GPS, spoil_fix=lasts(20.0, 23.0)).sail(30.0)
    told_s = [(event.stamp_ns - EPOCH_NS) * 1e-9 for event in boat.named("gps_lost")]
    assert told_s == pytest.approx([20.5, 21.5, 22.5], abs=0.06)
    assert "the position is known to" in boat.named("gps_lost")[0].detail
    (back,) = boat.named("gps_back")
    assert (back.stamp_ns - EPOCH_NS) * 1e-9 == pytest.approx(23.0, abs=0.06)
    stamps_ns = [odometry.stamp_ns for odometry in boat.odometry]
    assert set(np.diff(stamps_ns).tolist()) == {50_000_000}
    assert boat.worst(skip_s=15.0)[0] < 1.5


def test_a_receiver_that_says_it_has_no_fix_is_a_receiver_that_is_silent():
    boat = Circling(gps=with_settings(EXACT_GPS, outages_s=((5.0, 7.0),))).sail(8.0)
    assert boat.named("gps_lost")
    assert boat.named("gps_back")


@pytest.mark.slow
def test_when_the_position_is_too_uncertain_there_is_no_odometry_until_fixes_are_back():
    boat = Circling(imu=ImuSettings(), gps=NOISY_GPS, spoil_fix=lasts(20.0, 60.0)).sail(65.0)
    (lost,) = boat.named("estimate_lost")
    lost_s = (lost.stamp_ns - EPOCH_NS) * 1e-9
    assert 23.0 < lost_s < 45.0
    silent = [o for o in boat.odometry if lost_s <= (o.stamp_ns - EPOCH_NS) * 1e-9 < 60.0]
    assert not silent
    assert len(boat.named("estimate_ready")) == 2
    assert (boat.odometry[-1].stamp_ns - EPOCH_NS) * 1e-9 == pytest.approx(65.0, abs=0.06)


@pytest.mark.slow
def test_it_knows_how_uncertain_it_becomes():
    """The error when it gives up is of the order of the limit, over many boats."""
    settings = EstimationSettings(datum=DATUM, usable_sigma_m=1.0)
    errors = []
    for seed in range(6):
        boat = Circling(settings, ImuSettings(), NOISY_GPS, seed=seed)
        boat.spoil_fix = lasts(10.0, 99.0)
        assert boat.sail(25.0).named("estimate_lost")
        errors.append(list(boat.errors())[-1][0][:2])
    assert 0.3 < np.sqrt(np.mean(np.square(errors))) < 1.6


def test_a_fix_far_off_is_not_used():
    def spoil(fix, time_s):
        place = FRAME.place(truth(time_s).position_N[0] + [30.0, 0.0, 0.0])
        odd = 10.0 < time_s < 10.3
        return replace(fix, latitude_deg=place.latitude_deg) if odd else fix

    boat = Circling(spoil_fix=spoil).sail(15.0)
    assert boat.worst(skip_s=8.0)[0] < 0.1
    assert not boat.named("gps_disagrees")


@pytest.mark.slow
def test_fixes_that_stay_far_off_are_believed_after_a_while():
    def spoil(fix, time_s):
        off_m = 30.0 if time_s > 10.0 else 0.0
        place = FRAME.place(FRAME.position_N(as_place(fix)) + np.array([0.0, off_m, 0.0]))
        return replace(fix, longitude_deg=place.longitude_deg)

    boat = Circling(spoil_fix=spoil).sail(20.0)
    (event,) = boat.named("gps_disagrees")
    assert (event.stamp_ns - EPOCH_NS) * 1e-9 == pytest.approx(12.05, abs=0.06)
    assert event.detail.startswith("30.0 m")
    error = boat.odometry[-1].position_N - truth(20.0).position_N[0]
    assert error[1] == pytest.approx(30.0, abs=0.2)


def as_place(fix):
    return Place(
        latitude_deg=fix.latitude_deg, longitude_deg=fix.longitude_deg, altitude_m=fix.altitude_m
    )


def test_a_unit_without_attitude_gives_no_odometry_and_says_why():
    boat = Circling(spoil_imu=lambda imu, _: replace(imu, q_NI=None)).sail(3.0)
    assert not boat.odometry
    assert len(boat.named("heading_unknown")) == 3


def test_after_a_silence_of_the_imu_it_starts_anew():
    boat = Circling(spoil_imu=lasts(5.0, 6.0)).sail(12.0)
    (gap,) = boat.named("imu_gap")
    assert "1.0" in gap.detail
    assert len(boat.named("estimate_ready")) == 2
    assert boat.worst(skip_s=9.0)[0] < 0.1


def test_messages_that_repeat_or_go_back_a_little_change_nothing():
    twice = Circling().sail(5.0)
    before = twice.estimator.inertial.x.copy()
    imu = twice._imu.sense(truth(5.0), EPOCH_NS + 4_990_000_000, 0.01)
    assert twice.estimator.imu(imu) is None
    np.testing.assert_array_equal(twice.estimator.inertial.x, before)


def test_a_clock_set_back_starts_it_anew():
    boat = Circling(
        spoil_imu=lambda imu, t: replace(
            imu, stamp_ns=imu.stamp_ns - (3600 * 10**9 if t > 5.0 else 0)
        ),
        spoil_fix=lambda fix, t: replace(
            fix, stamp_ns=fix.stamp_ns - (3600 * 10**9 if t > 5.0 else 0)
        ),
    ).sail(10.0)
    assert len(boat.named("imu_gap")) == 1
    assert boat.odometry[-1].stamp_ns < EPOCH_NS
    assert len(boat.odometry) > 140


@pytest.mark.slow
def test_a_better_receiver_counts_for_more():
    """Covariances are those of the messages."""
    good = Circling(imu=ImuSettings(), gps=with_settings(NOISY_GPS, horizontal_sigma_m=0.05))
    bad = Circling(imu=ImuSettings(), gps=with_settings(NOISY_GPS, horizontal_sigma_m=2.0))
    sigma = [float(np.sqrt(boat.sail(10.0).estimator.inertial.P[0, 0])) for boat in (good, bad)]
    assert sigma[0] < 0.05
    assert sigma[1] > 0.2


def test_the_arm_to_the_imu_and_the_gyroscopes_bias_are_taken_away():
    rates_B = np.array([0.0, 0.0, 0.5])
    sample = ImuSample(7, rates_B, np.array([0.0, 0.0, -9.81]), None, None, None, None)
    x = np.zeros(15)
    x[:3], x[6:9] = (10.0, 20.0, 0.0), (0.0, 0.0, np.pi / 2)
    x[3:6] = (-0.1, 2.0, 0.0)  # the unit swings to the south as the bow turns to starboard
    x[9:12] = (0.0, 0.0, 0.3)
    given = odometry(sample, x, np.array([0.5, 0.0, -1.0]))
    assert given.stamp_ns == 7
    np.testing.assert_allclose(given.position_N, [10.0, 19.5, 1.0], atol=1e-12)
    np.testing.assert_allclose(given.velocity_B, [2.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(given.rates_B, [0.0, 0.0, 0.2])
    np.testing.assert_allclose(given.q_NB, [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
