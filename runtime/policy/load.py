"""What a policy is, and how one is found by what the user typed."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from msgspec.structs import replace

from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.runtime.messages.types import Float32, Float64, Observation
from twinscrew.runtime.policy.hull_units import HullUnits, describe_hull, in_units, units_of
from twinscrew.runtime.policy.metadata import PolicyExpectation
from twinscrew.runtime.policy.observation import Shown
from twinscrew.runtime.policy.risk import RiskSettings
from twinscrew.runtime.policy.vessel_model import VesselParameters
from twinscrew.runtime.settings import load, shipped
from twinscrew.runtime.vessel_description import VesselDescription, load_vessel

SLOWEST = 4.0
"""[-] A planner looks at most so much farther ahead for a hull that answers more slowly."""
PLANNERS = ("apf", "mpc", "orca", "sbmpc")
"""Policies that are no files: they look ahead with the vessel's own model."""


@runtime_checkable
class Policy(Protocol):
    """A function of the observation that answers with thrust rates: an ONNX file or a planner."""

    @property
    def name(self) -> str:
        """What the policy calls itself, as "ac_iqn"."""

    @property
    def period_s(self) -> float:
        """[s] Time between two decisions that the policy was made for."""

    @property
    def shown(self) -> Shown:
        """What the policy takes."""

    def act(self, observation: Observation) -> Float64:
        """Give the thrust rates, (2,) [N/s] left and right, for what is seen.

        Raises
        ------
        PolicyError
            The policy gave anything but two finite numbers.
        """

    def reset(self) -> None:
        """Forget everything remembered of a run."""


class InHullUnits:
    """A policy made for the default vessel's units that drives another hull."""

    def __init__(self, policy: Policy, units: HullUnits, hull: Float32 | None = None) -> None:
        """Wrap a policy.

        Parameters
        ----------
        policy
            Who decides, in the default vessel's units.
        units
            Of the hull that it drives.
        hull : (10,) float32
            What a policy is told that takes a hull's description, in these units.
        """
        self.policy = policy
        self.units = units
        length, time, force = units
        speed = units.speed
        inner = policy.shown
        reach = inner.contour_m
        self.shown = inner._replace(
            range_m=inner.range_m * length,
            contour_m=None if reach is None else reach * length,
        )
        ego = (length, length, speed, speed, 1.0 / time, force, force)
        self._ego = (1.0 / np.array(ego)).astype(np.float32)
        self._outline = (1.0 / np.array([length, length, 1.0])).astype(np.float32)
        self._hull = hull
        self._object = (1.0 / np.array([length, length, speed, speed, length])).astype(np.float32)

    @property
    def sha256(self) -> str:
        """The policy file's hash; empty if it is no file."""
        return str(getattr(self.policy, "sha256", ""))

    @property
    def name(self) -> str:
        """What the policy calls itself."""
        return self.policy.name

    @property
    def period_s(self) -> float:
        """[s] Time between two decisions."""
        return self.policy.period_s * self.units.time

    def act(self, observation: Observation) -> Float64:
        """Give the thrust rates, (2,) [N/s]; see `Policy.act`."""
        seen = Observation(
            ego=observation.ego * self._ego,
            objects=observation.objects * self._object,
            mask=observation.mask,
            outlines=None if observation.outlines is None else observation.outlines * self._outline,
            hull=self._hull,
            contour=None if observation.contour is None else observation.contour * self._ego[0],
        )
        return self.policy.act(seen) * (self.units.force / self.units.time)

    def reset(self) -> None:
        """Forget everything remembered of a run."""
        self.policy.reset()


def load_policy(
    spec: str | Path,
    expect: PolicyExpectation | None = None,
    risk: RiskSettings = RiskSettings(),  # noqa: B008 - frozen
    vessel: VesselDescription | None = None,
) -> Policy:
    """Give a policy.

    Parameters
    ----------
    spec
        ``apf``, ``mpc``, ``orca``, ``sbmpc``, the name of a shipped policy, or an ONNX file.
    expect
        What the vessel needs a policy file to have been made for.
    risk
        How cautious a policy that takes a risk level is to be.
    vessel
        Whom the planners plan for; None: the default vessel.

    Raises
    ------
    PolicyError
        There is no such policy, the file is not one, or it takes no risk level and one is set.
    """
    if spec in PLANNERS:
        if risk.level != "shipped":
            raise PolicyError(f"{spec} takes no risk level; allowed: 'shipped', got {risk.level!r}")
        return _planner(str(spec), vessel or load_vessel())
    try:
        path = shipped("policies", spec, ".onnx")
    except ConfigError as error:
        raise PolicyError(f"{error}; or {', '.join(PLANNERS)}, or an ONNX file") from error
    # What is not used is not imported: a planner needs no ONNX Runtime.
    from twinscrew.runtime.policy.onnx import OnnxPolicy

    policy = OnnxPolicy(path, expect, risk)
    if policy.metadata.vessel != "any":
        return policy
    hull = vessel or load_vessel()
    units = units_of(hull, load_vessel())
    lag_s = hull.thrusters.time_constant_s / units.time
    told = describe_hull(in_units(hull.plane, units), lag_s).astype(np.float32)
    return InHullUnits(policy, units, told)


def _planner(name: str, vessel: VesselDescription) -> Policy:
    """Give a planner for a vessel: in the default vessel's units, with the vessel's own model."""
    from twinscrew.runtime.policy.planners import ApfPolicy, ApfSettings, MpcPolicy, MpcSettings

    units = units_of(vessel, load_vessel())
    model, radius = in_units(vessel.plane, units), vessel.radius_m / units.length
    # A hull that turns or gathers way slowly has to look farther ahead to see what that leads to.
    usual = VesselParameters()
    answers = max(usual.turn_rate / model.turn_rate, model.inertia[0] / usual.inertia[0])
    slower = min(max(answers, 1.0), SLOWEST)
    path = shipped("policies", name)
    policy: Policy
    if name == "apf":
        field = load(path, ApfSettings)
        look_s = slower * field.look_s
        policy = ApfPolicy(replace(field, vessel=model, own_radius_m=radius, look_s=look_s))
    elif name == "orca":
        from twinscrew.runtime.policy.velocity_obstacles import OrcaPolicy, OrcaSettings

        sides = load(path, OrcaSettings)
        look_s = slower * sides.look_s
        policy = OrcaPolicy(replace(sides, vessel=model, own_radius_m=radius, look_s=look_s))
    elif name == "sbmpc":
        from twinscrew.runtime.policy.scenario_mpc import ScenarioMpcPolicy, ScenarioMpcSettings

        far = load(path, ScenarioMpcSettings)
        look_s = slower * far.look_s
        rate = far.turn_rate_radps / slower
        far = replace(far, vessel=model, own_radius_m=radius, look_s=look_s, turn_rate_radps=rate)
        policy = ScenarioMpcPolicy(replace(far, slowing_mps2=far.slowing_mps2 / slower))
    else:
        horizon = load(path, MpcSettings)
        step_s = slower * horizon.step_s
        policy = MpcPolicy(replace(horizon, vessel=model, own_radius_m=radius, step_s=step_s))
    return policy if units == (1.0, 1.0, 1.0) else InHullUnits(policy, units)
