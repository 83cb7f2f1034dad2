"""Print the fidelity figures of docs/simulator.md: `python tests/reference/fidelity.py`."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
from msgspec.structs import replace
from tests.reference.sailing import calm, euler, paper_sea, sail, series, windy

from twinscrew.hil_sim.sea.sea import Sea, SeaSettings, WindSettings
from twinscrew.hil_sim.vessel.dynamics import VesselDynamics, as_vrx
from twinscrew.hil_sim.vessel.rest import at_rest, equilibrium
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.vessel_description import load_vessel

OURS = VesselDynamics(load_vessel())
VRX = VesselDynamics(load_vessel(), as_vrx())


def resting(heading: float = 0.0) -> VesselState:
    return at_rest(OURS, np.zeros((1, 2)), np.array([heading]))


def speeds(dynamics: VesselDynamics, dt: float) -> None:
    for name, thrust in (("ahead", (1000, 1000)), ("astern", (-500, -500))):
        states = sail(dynamics, resting(), thrust, calm(), 40, dt)
        u = np.abs(series(states, "velocity_B", 0))
        print(f"full {name}: {u[-1]:.3f} m/s; 90 % after {dt * np.argmax(u > 0.9 * u[-1]):.1f} s")


def stopping(dt: float = 0.01) -> None:
    moving = sail(OURS, resting(), (1000, 1000), calm(), 40, dt)[-1]
    for name, thrust in (("propellers off", (0, 0)), ("full astern", (-500, -500))):
        states = sail(OURS, moving, thrust, calm(), 30, dt)
        u, x = series(states, "velocity_B", 0), series(states, "position_N", 0)
        i = int(np.argmax(u < (0.1 if thrust == (0, 0) else 0.0)))
        print(f"stopping, {name}: {x[i] - x[0]:.2f} m in {i * dt:.1f} s")


def turning(dynamics: VesselDynamics, thrust: tuple[float, float], dt: float) -> None:
    straight = sail(dynamics, resting(), (1000, 1000), calm(), 40, dt)[-1]
    states = sail(dynamics, straight, thrust, calm(), 60, dt)
    heading = np.unwrap([state.heading[0] for state in states])
    x, y = series(states, "position_N", 0), series(states, "position_N", 1)
    quarter, half = (int(np.argmax(heading > angle)) for angle in (np.pi / 2, np.pi))
    v, r = np.linalg.norm(states[-1].velocity_B[0, :2]), states[-1].rates_B[0, 2]
    drift = np.degrees(np.arctan2(-states[-1].velocity_B[0, 1], states[-1].velocity_B[0, 0]))
    print(
        f"turning circle {thrust}: advance {x[quarter] - x[0]:.2f} m, transfer "
        f"{y[quarter] - y[0]:.2f} m, tactical diameter {y[half] - y[0]:.2f} m, steady diameter "
        f"{2 * v / r:.2f} m at {v:.2f} m/s, {np.degrees(r):.1f} deg/s, drift angle {drift:.1f} deg"
    )


def zigzag(dt: float = 0.01) -> None:
    side = [1.0]

    def thrust(state: VesselState, _t: float) -> tuple[float, float]:
        if state.heading[0] * side[0] > np.radians(20):
            side[0] = -side[0]
        return 650 + 350 * side[0], 650 - 350 * side[0]

    straight = sail(OURS, resting(), (650, 650), calm(), 40, dt)[-1]
    heading = np.degrees([s.heading[0] for s in sail(OURS, straight, thrust, calm(), 60, dt)])
    up = np.flatnonzero((heading[:-1] < 0) & (heading[1:] >= 0))
    print(
        f"zig-zag 20/20: overshoot {heading.max() - 20:.1f} and {-heading.min() - 20:.1f} deg, "
        f"period {np.mean(np.diff(up)) * dt:.2f} s"
    )


def drifting() -> None:
    end = sail(OURS, resting(0.5), (0, 0), windy(10, 90), 300)[-1]
    print(f"drift in 10 m/s: {np.linalg.norm(end.velocity_B[0]):.3f} m/s, beam on")
    for heading in (0.0, 45.0, 90.0):
        moved = []
        for dynamics, dt in ((OURS, 0.01), (VRX, 0.05)):
            start = resting(np.radians(heading))
            moved.append(sail(dynamics, start, (0, 0), windy(10, 90), 10, dt)[-1])
        for name, end in zip(("ours", "VRX"), moved, strict=True):
            print(
                f"  heading {heading:.0f}, 10 s of wind from the east, {name}: "
                f"{np.round(end.position_N[0, :2], 2)} m, {np.degrees(end.heading[0]):.1f} deg"
            )


def swinging() -> None:
    down, pitch = equilibrium(OURS)
    print(f"rest: draught {down:.4f} m, pitch {np.degrees(pitch):.3f} deg")
    still = resting()
    tilt = 0.02
    starts = {
        "heave": dataclasses.replace(still, position_N=still.position_N - [0, 0, 0.01]),
        "roll": dataclasses.replace(still, q_NB=np.array([[np.cos(tilt), np.sin(tilt), 0, 0]])),
        "pitch": dataclasses.replace(still, q_NB=np.array([[np.cos(tilt), 0, np.sin(tilt), 0]])),
    }
    for i, (name, start) in enumerate(starts.items()):
        states = sail(OURS, start, (0, 0), calm(), 6, 0.001)
        tilts = np.array([euler(s)[0] for s in states])
        x = (series(states, "position_N", 2) - down, tilts[:, 0], tilts[:, 1] - pitch)[i]
        size = np.abs(x)
        peaks = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
        decrement = np.log(size[peaks[0]] / size[peaks[2]])
        ratio = decrement / np.hypot(2 * np.pi, decrement)
        period = 2 * np.mean(np.diff(peaks[:4])) * 0.001
        print(f"{name}: period {period:.3f} s, damping ratio {ratio:.3f}")


def in_waves() -> None:
    waves = SeaSettings().waves
    for gain in (0.3, 0.6):
        settings = SeaSettings(waves=replace(waves, gain=gain), wind=WindSettings(mean_mps=0.0))
        sea = Sea(settings, np.random.default_rng(0))
        for thrust in ((0, 0), (600, 600)):
            for heading in (0.0, 90.0, 180.0, 270.0):
                states = sail(OURS, resting(np.radians(heading)), thrust, sea, 120)[3000:]
                tilts = np.degrees([euler(s)[0, :2] for s in states]).std(axis=0)
                heave = series(states, "position_N", 2).std()
                print(
                    f"gain {gain}, thrust {thrust}, heading {heading:.0f}: rms heave {heave:.3f} "
                    f"m, roll {tilts[0]:.2f} deg, pitch {tilts[1]:.2f} deg"
                )


def converging() -> None:
    ends = {}
    for dt in (0.05, 0.02, 0.01, 0.005, 0.0003125):
        ends[dt] = sail(OURS, resting(), (800, -200), paper_sea(), 10, dt)[-1]
    exact = ends.pop(0.0003125)
    for dt, end in ends.items():
        error = np.linalg.norm(end.position_N - exact.position_N)
        turned = np.degrees(abs(end.heading - exact.heading)[0])
        print(f"step {1000 * dt:.0f} ms: {1000 * error:.1f} mm, {turned:.2f} deg after 10 s")


if __name__ == "__main__":
    for dynamics, dt in ((OURS, 0.01), (VRX, 0.05)):
        print("VRX's step" if dynamics is VRX else "our step")
        speeds(dynamics, dt)
        turning(dynamics, (1000, 500), dt)
        turning(dynamics, (1000, -500), dt)
    stopping()
    zigzag()
    drifting()
    swinging()
    in_waves()
    converging()
