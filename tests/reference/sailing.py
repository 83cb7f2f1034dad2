"""Vessels and voyages that several tests of the physics share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.sea.sea import Sea, SeaSettings, WaveSettings, WindSettings
from twinscrew.hil_sim.vessel.dynamics import VesselDynamics
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.vessel_description import Part, VesselDescription, load_vessel

Array = NDArray[np.float64]

NO_WAVES = WaveSettings(gain=0.0)
NO_WIND = WindSettings(mean_mps=0.0)


def calm(current_mps: tuple[float, float] = (0.0, 0.0)) -> Sea:
    settings = SeaSettings(waves=NO_WAVES, wind=NO_WIND, current_mps=current_mps)
    return Sea(settings, np.random.default_rng(0))


def windy(mean_mps: float, from_deg: float) -> Sea:
    wind = WindSettings(mean_mps=mean_mps, from_deg=from_deg)
    return Sea(SeaSettings(waves=NO_WAVES, wind=wind), np.random.default_rng(0))


def paper_sea() -> Sea:
    return Sea(SeaSettings(), np.random.default_rng(0))


def centred_vessel() -> VesselDescription:
    """A vessel whose motions do not couple: weight, lift and thrust act through base_link."""
    p = load_vessel()
    part = Part(name="all", mass_kg=280.0, position_m=(0, 0, 0), inertia_kgm2=(280.0, 650.0, 700.0))
    points = np.array([[1.0, -1.03, 0], [-1.0, -1.03, 0], [1.0, 1.03, 0], [-1.0, 1.03, 0]])
    thrusters = replace(p.thrusters, positions_B=np.array([[-2.5, -1.0, 0], [-2.5, 1.0, 0]]))
    buoyancy = replace(p.buoyancy, points_B=points)
    windage = replace(p.windage, along=0.0, across=0.0, yaw=0.0)
    return replace(p, parts=(part,), buoyancy=buoyancy, thrusters=thrusters, windage=windage)


def sail(
    dynamics: VesselDynamics,
    state: VesselState,
    command: Array | tuple[float, float] | Callable[[VesselState, float], Array],
    sea: Sea,
    seconds: float,
    dt_s: float = 0.01,
    start_s: float = 0.0,
) -> list[VesselState]:
    """Give the state before each step and after the last one."""
    states = [state]
    for i in range(round(seconds / dt_s)):
        now = start_s + i * dt_s
        thrust = command(states[-1], now) if callable(command) else command
        each = np.broadcast_to(np.asarray(thrust, dtype=np.float64), (state.count, 2)).copy()
        states.append(dynamics.step(states[-1], each, sea, now, dt_s))
    return states


def series(states: list[VesselState], field: str, axis: int, vessel: int = 0) -> Array:
    """Give one component of one vessel over time."""
    return np.array([getattr(state, field)[vessel, axis] for state in states])


def euler(state: VesselState) -> Array:
    """Give roll, pitch and yaw, (V, 3) [rad]."""
    w, x, y, z = state.q_NB.T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    return np.column_stack([roll, pitch, state.heading])
