"""Find a policy by what the user typed."""

from __future__ import annotations

from pathlib import Path

from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.runtime.policy.base import Policy
from twinscrew.runtime.policy.metadata import PolicyExpectation
from twinscrew.runtime.policy.risk import RiskSettings
from twinscrew.runtime.settings import load, shipped


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
        from twinscrew.runtime.policy.apf import ApfPolicy, ApfSettings

        return ApfPolicy(load(shipped("experiments", "apf"), ApfSettings))
    if spec == "mpc":
        from twinscrew.runtime.policy.mpc import MpcPolicy, MpcSettings

        return MpcPolicy(load(shipped("experiments", "mpc"), MpcSettings))
    try:
        path = shipped("policies", spec, ".onnx")
    except ConfigError as error:
        raise PolicyError(f"{error}; or apf, mpc, or an ONNX file") from error
    from twinscrew.runtime.policy.onnx import OnnxPolicy

    return OnnxPolicy(path, expect, risk)
