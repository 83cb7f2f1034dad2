"""Every stage has a budget, and figures are printed beside theirs."""

from pathlib import Path

import pytest

from twinscrew.hil_sim.bench.budgets import compared, load_budgets, require
from twinscrew.hil_sim.bench.latency import DENSITIES, STAGES, clouds, stage_names
from twinscrew.runtime.errors import ConfigError


def written(folder: Path, text: str) -> Path:
    file = folder / "budgets.toml"
    file.write_text(text)
    return file


def test_every_stage_of_every_density_has_a_budget() -> None:
    require(load_budgets(), DENSITIES, STAGES)


def test_the_stages_are_those_that_are_measured() -> None:
    assert stage_names(clouds()["sparse"][:2]) == STAGES


def test_a_stage_without_a_budget_is_an_error_that_names_it() -> None:
    with pytest.raises(ConfigError, match=r"latency\.sparse\.radar\.p50_ms.*no budget"):
        require(load_budgets(), ("sparse",), (*STAGES, "radar"))
    with pytest.raises(ConfigError, match="no budget"):
        require({}, ("sparse",), ("step",))


def test_figures_are_put_beside_their_budgets(tmp_path: Path) -> None:
    text = "[at_most.latency.sparse]\nstep = {p50_ms = 1.0, p99_ms = 2}\n[at_least]\nfactor = 20.0"
    results = {"latency": {"sparse": {"step": {"p50_ms": 0.5, "p99_ms": 2.5}}}, "factor": 25.0}
    found = compared(results, load_budgets(written(tmp_path, text)))
    assert found == {
        "latency.sparse.step.p50_ms": {"figure": 0.5, "budget": 1.0, "kept": True},
        "latency.sparse.step.p99_ms": {"figure": 2.5, "budget": 2, "kept": False},
        "factor": {"figure": 25.0, "budget": 20.0, "kept": True},
    }


def test_what_was_not_measured_is_left_out() -> None:
    assert compared({}, load_budgets()) == {}


@pytest.mark.parametrize(
    "text", ["[about]\nx = 1", "at_most = 3", "[at_most]\nx = 'fast'", "[at_most]\nx = true"]
)
def test_what_is_no_limit_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError):
        load_budgets(written(tmp_path, text))
