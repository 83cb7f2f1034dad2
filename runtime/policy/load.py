"""What every policy is: a function of the observation that answers with thrust rates."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, runtime_checkable

from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.runtime.messages.types import Float64, Observation
from twinscrew.runtime.policy.metadata import PolicyExpectation
from twinscrew.runtime.policy.risk import RiskSettings
from twinscrew.runtime.settings import load, shipped


@runtime_checkable
class Policy(Protocol):
    """A policy: ONNX, APF or MPC."""

    @property
    def name(self) -> str:
        """What the policy calls itself, as "ac_iqn"."""

    @property
    def period_s(self) -> float:
        """[s] Time between two decisions that the policy was made for."""

    def act(self, observation: Observation) -> Float64:
        """Give the thrust rates, (2,) [N/s] left and right, for what is seen.

        Raises
        ------
        PolicyError
            The policy gave anything but two finite numbers.
        """

    def reset(self) -> None:
        """Forget everything remembered of a run."""


# -- Find a policy by what the user typed.


def load_policy(
    spec: str | Path,
    expect: PolicyExpectation | None = None,
    risk: RiskSettings = RiskSettings(),  # noqa: B008 - frozen
) -> Policy:
    """Give a policy.

    Parameters
    ----------
    spec
        ``apf``, ``mpc``, the name of a shipped policy, or an ONNX file.
    expect
        What the vessel needs a policy file to have been made for.
    risk
        How cautious a policy that takes a risk level is to be.

    Raises
    ------
    PolicyError
        There is no such policy, the file is not one, or it takes no risk level and one is set.
    """
    if spec in ("apf", "mpc") and risk.level != "shipped":
        raise PolicyError(f"{spec} takes no risk level; allowed: 'shipped', got {risk.level!r}")
    # What is not used is not imported: a baseline needs no ONNX Runtime.
    if spec == "apf":
        from twinscrew.runtime.policy.planners import ApfPolicy, ApfSettings

        return ApfPolicy(load(shipped("experiments", "apf"), ApfSettings))
    if spec == "mpc":
        from twinscrew.runtime.policy.planners import MpcPolicy, MpcSettings

        return MpcPolicy(load(shipped("experiments", "mpc"), MpcSettings))
    try:
        path = shipped("policies", spec, ".onnx")
    except ConfigError as error:
        raise PolicyError(f"{error}; or apf, mpc, or an ONNX file") from error
    from twinscrew.runtime.policy.onnx import OnnxPolicy

    return OnnxPolicy(path, expect, risk)
