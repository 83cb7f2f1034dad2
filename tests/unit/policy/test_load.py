"""Finding a policy by what the user typed."""

import importlib.util
from pathlib import Path

import pytest

from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.policy.load import load_policy
from twinscrew.runtime.policy.metadata import PolicyExpectation

_spec = importlib.util.spec_from_file_location("graphs", Path(__file__).with_name("graphs.py"))
graphs = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(graphs)


@pytest.mark.parametrize("name", ["apf", "mpc"])
def test_the_baselines_are_found_by_name(name):
    policy = load_policy(name)
    assert (policy.name, policy.period_s) == (name, 0.5)


def test_a_file_is_found_by_its_path(tmp_path):
    assert load_policy(graphs.save(tmp_path)).name == "hand_made"
    assert load_policy(str(tmp_path / "policy.onnx")).name == "hand_made"


def test_what_the_vessel_needs_is_checked(tmp_path):
    with pytest.raises(PolicyError, match="thrust_max_n"):
        load_policy(graphs.save(tmp_path), PolicyExpectation(thrust_max_n=1.0))


@pytest.mark.parametrize("spec", ["no_such_policy", "missing/policy.onnx", ""])
def test_an_unknown_policy_is_refused_with_what_there_is(spec):
    with pytest.raises(PolicyError, match="apf, mpc"):
        load_policy(spec)
