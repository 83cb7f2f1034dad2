"""What the doctor looks at of the policy: that it answers, and what is known of it."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from twinscrew.runtime.app.finding import Finding, fail, ok, warn
from twinscrew.runtime.messages.types import OBSERVED_OBJECTS, Observation
from twinscrew.runtime.policy.load import Policy, load_policy
from twinscrew.runtime.policy.onnx import OnnxPolicy
from twinscrew.runtime.settings import shipped
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel.pipeline import expected_of_policies
from twinscrew.runtime.vessel_description import load_vessel

SAME = ("training_run", "commit", "created")
"""What a policy file and its card must agree on."""
WORTHY = 0.9
"""[-] A policy that fails oftener than this in one of the paper's settings is worth a warning."""


def _policy_of(config: RuntimeConfig) -> Policy:
    vessel = load_vessel(config.vessel)
    return load_policy(config.policy, expected_of_policies(config), config.risk, vessel)


def check_policy(config: RuntimeConfig) -> Finding:
    """Load the policy, and ask it the same thing twice."""
    policy = _policy_of(config)
    blank = Observation(
        ego=np.array([20, 0, 0, 0, 0, 0, 0], dtype=np.float32),
        objects=np.zeros((OBSERVED_OBJECTS, 5), dtype=np.float32),
        mask=np.zeros(OBSERVED_OBJECTS, dtype=np.float32),
    )
    first, second = policy.act(blank), policy.act(blank)
    found = f"{policy.name}, a decision every {policy.period_s:g} s"
    if not np.array_equal(first, second):
        return fail("policy", f"{found}; answers differ", "use another policy")
    return ok("policy", found)


def check_card(config: RuntimeConfig) -> Finding:
    """Compare the policy with the card beside it, and tell what the card says it can do."""
    policy = _policy_of(config)
    if not isinstance(policy, OnnxPolicy):
        return ok("policy card", f"{policy.name} needs none: it is no trained file")
    path = shipped("policies", config.policy, ".onnx").with_suffix(".json")
    if not path.is_file():
        return warn("policy card", f"no {path.name}", "take it along: `twinscrew export` writes it")
    try:
        card = json.loads(path.read_bytes())
        told = {key: card["metadata"][key] for key in SAME}
        rates = [float(setting["success_rate"]) for setting in card["scores"]["settings"]]
        if not rates or not all(0.0 <= rate <= 1.0 for rate in rates):
            raise ValueError(f"success rates {rates}")
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        return fail("policy card", f"{path.name} is no card: {error!r}", "export the policy again")
    return _judged(policy, told, rates)


def _judged(policy: OnnxPolicy, told: dict[str, Any], rates: list[float]) -> Finding:
    for key, value in told.items():
        given = getattr(policy.metadata, key)
        if given != value:
            found = f"of another file: {key} is {value}, the policy's {given}"
            return fail("policy card", found, "put the card and the file that belong together")
    least, most = min(rates), max(rates)
    found = f"{told['training_run']}, {100 * least:.1f} to {100 * most:.1f} % success in training"
    if least < WORTHY:
        return warn("policy card", found, "a policy that fails this often is not for the water")
    return ok("policy card", found)
