"""Makes the tables of docs/estimation.md.

python -m tests.hil_sim.estimation_table accuracy --seeds 6
python -m tests.hil_sim.estimation_table arrivals --seeds 20
"""

from __future__ import annotations

import argparse
from collections import Counter, deque
from collections.abc import Iterator

import numpy as np

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sensors.navigation import Navigation, NavigationSettings, ReceiverSettings
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.hil_sim.sitl_runtimes import DATUM
from twinscrew.hil_sim.sitl_settings import OdometrySource
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.estimation.estimator import EstimationSettings, Estimator
from twinscrew.runtime.estimation.inertial import ATTITUDE, GYRO_BIAS, POSITION, VELOCITY
from twinscrew.runtime.geometry import euler_from_quaternion, rotation_from_quaternion, wrap
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Fix, Float64

SAIL_S, SKIP_S, THRUST_S = 30.0, 5.0, 2.0
RECEIVERS = {
    "0.5 m white, 20 Hz": (ReceiverSettings(), 0.0),
    "the same, 5 Hz": (ReceiverSettings(rate_hz=5.0), 0.0),
    "the same, 0.2 s late": (ReceiverSettings(), 0.2),
    "2 m white, 20 Hz": (ReceiverSettings(horizontal_sigma_m=2.0, vertical_sigma_m=4.0), 0.0),
    "0.02 m white, 20 Hz": (ReceiverSettings(horizontal_sigma_m=0.02, vertical_sigma_m=0.04), 0.0),
    "0.5 m white, 1 m wanders": (ReceiverSettings(wander_sigma_m=1.0), 0.0),
}
STATES = [0, 1, *range(3, 12)]
"""All but the height and the force's bias."""


def looks(receiver: ReceiverSettings, late_s: float, seed: int) -> Iterator[tuple[Float64, float]]:
    """Give errors of the filter's state, (15,), and its NEES, ten times a second."""
    world = make_world(load_scenario("random", 1, 0, seed), seed=seed)
    navigation = Navigation(world, NavigationSettings(receiver=receiver))
    estimator = Estimator(EstimationSettings(datum=DATUM))
    rng, fixes = np.random.default_rng(seed), deque[Fix]()
    while world.time_s < SAIL_S:
        if world.time_s % THRUST_S < 0.05:
            thrust = rng.uniform(-200.0, 900.0, (1, 2))
        world.advance(0.1, thrust)
        for _, topic, payload in navigation.take():
            if topic == "gps":
                fixes.append(cdr.decode_fix(payload))
                continue
            imu = cdr.decode_imu(payload)
            estimator.imu(imu)
            while fixes and fixes[0].stamp_ns + round(1e9 * late_s) <= imu.stamp_ns:
                estimator.fix(fixes.popleft())
        if world.time_s > SKIP_S:
            e = error(world, navigation, estimator)
            part = e[STATES]
            P = estimator.inertial.P[np.ix_(STATES, STATES)]
            yield e, float(part @ np.linalg.solve(P, part)) / len(STATES)


def error(world, navigation, estimator) -> Float64:
    """Give the estimate's error, (15,)."""
    state, arm_B = world.state, estimator.placement.imu_B
    R_NB = rotation_from_quaternion(state.q_NB[0])
    x = np.zeros(15)
    x[POSITION] = state.position_N[0] + R_NB @ arm_B
    x[VELOCITY] = R_NB @ (state.velocity_B[0] + np.cross(state.rates_B[0], arm_B))
    x[ATTITUDE] = euler_from_quaternion(state.q_NB[0])
    x[GYRO_BIAS], x[12:] = navigation.imus[0].gyro.bias, navigation.imus[0].force.bias
    e: Float64 = x - estimator.inertial.x
    e[ATTITUDE] = wrap(e[ATTITUDE])
    return e


def accuracy(seeds: int) -> None:
    """Print a row a receiver."""
    print("| receiver | position | worst | velocity | tilt | heading | NEES |")
    for name, (receiver, late_s) in RECEIVERS.items():
        seen = [look for seed in range(seeds) for look in looks(receiver, late_s, seed)]
        e = np.array([look[0] for look in seen])
        rms = np.sqrt((e**2).mean(axis=0))
        across = np.hypot(e[:, 0], e[:, 1])
        figures = np.hypot(*rms[:2]), across.max(), np.hypot(*rms[3:5]), rms[6], rms[8]
        nees = np.mean([look[1] for look in seen])
        print("|", name, "|", " | ".join(f"{f:.3f}" for f in figures), f"| {nees:.2f} |")


def arrivals(seeds: int) -> None:
    """Print a row a source of odometry."""
    wandering = NavigationSettings(receiver=ReceiverSettings(wander_sigma_m=1.0))
    rows = [(source, NavigationSettings()) for source in OdometrySource]
    for source, navigation in [*rows, (OdometrySource.GPS_IMU, wandering)]:
        vessels, runs = [], 0
        for seed in range(seeds):
            settings = SitlSettings(
                seed=seed, lockstep=True, odometry=source, navigation=navigation
            )
            report = sail(load_scenario("random", 3, 2, seed), settings)
            vessels += report.vessels
            runs += report.success
        times_s = [v.travel_time_s for v in vessels if v.outcome == "goal"]
        nearest_m = min(v.closest_approach_m for v in vessels)
        wanders = navigation.receiver.wander_sigma_m
        print(f"| {source.value} {wanders:g} | {runs} of {seeds} |", end=" ")
        print(dict(Counter(v.outcome for v in vessels)), end=" ")
        print(f"| {np.mean(times_s):.1f} s | {nearest_m:.2f} m |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", choices=["accuracy", "arrivals"])
    parser.add_argument("--seeds", type=int, default=6)
    wanted = parser.parse_args()
    {"accuracy": accuracy, "arrivals": arrivals}[wanted.table](wanted.seeds)
