"""From a training run's directory to the network that it learnt."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert
from twinscrew.training import runs
from twinscrew.training.agents import AnyAgentSettings, algorithm, make_agent, risk_levels
from twinscrew.training.networks import Beside, Pilot
from twinscrew.training.settings import TrainSettings, phase_settings


def which_checkpoint(folder: Path, *, last: bool = False) -> str:
    """Give the name of the checkpoint to export: the best, or the last; else what there is."""
    first = (runs.CHECKPOINT,) if last else (runs.BEST, runs.CHECKPOINT)
    names = [name for name in (*first, runs.LATEST) if (folder / name).is_file()]
    return names[0] if names else first[0]


def load_run(
    folder: Path,
    checkpoint: str = runs.BEST,
    radius_margin: float | None = None,
    risk: float | None = None,
    open_water: Path | None = None,
) -> tuple[Pilot, TrainSettings, dict[str, Any]]:
    """Read a run directory.

    Parameters
    ----------
    folder
        Of one seed.
    checkpoint
        The name of its file.
    radius_margin, risk
        Other than what the run was told.
    open_water
        A run directory whose actor acts where no edge is near (`networks.Beside`).

    Returns
    -------
    policy, settings, trained
        The network (observations to actions); what the run was told; how it came about, for the
        policy's card.

    Raises
    ------
    ConfigError
        It is not a run directory, its checkpoint cannot be read, or a risk level is asked of a
        policy that takes none.
    """
    file = folder / runs.CONFIG
    if not file.is_file():
        raise ConfigError(f"no training run here ({runs.CONFIG} is missing)", file=folder)
    told = runs.read_told(folder)
    settings = convert(told["settings"], TrainSettings, file=file)
    with runs.understood(file):
        agent = make_agent(settings.agent, int(told["seed"]), "cpu")
    content = runs.load_checkpoint(folder / checkpoint, algorithm(settings.agent))
    log = runs.read_records(folder / runs.LOG)
    with runs.understood(folder / checkpoint):
        agent.restore(content["agent"])
        phase = settings.phases[content["phase"]]
        trained = {
            "configuration": told["settings"],
            "seed": told["seed"],
            "checkpoint": {**content["where"], "selected_on": json.loads(content["score"])},
            "machine": next((r["machine"] for r in log if r.get("event") == "start"), "unknown"),
        }
    agent.retune(_at_risk(phase_settings(settings, phase).agent, risk))
    if radius_margin is not None:
        settings = msgspec.structs.replace(settings, radius_margin=radius_margin)
    pilot = agent.deployed(settings.radius_margin)
    if open_water is not None:
        pilot, trained["open_water"] = _beside(pilot, settings, open_water)
    return pilot, settings, trained


def _beside(edges: Pilot, settings: TrainSettings, folder: Path) -> tuple[Pilot, dict[str, Any]]:
    """Let a run's last actor act where no edge is near; say which it is."""
    open_water, _, trained = load_run(folder, which_checkpoint(folder, last=True))
    sees, takes_level = settings.agent.network, edges.risk is not None
    fits = open_water.see.scales == edges.see.scales and open_water.see.kind == edges.see.kind
    if not sees.contour or not fits or (open_water.risk is not None) != takes_level:
        raise ConfigError("a contour, and two runs that see alike, are needed", key="--open-water")
    both = Beside(open_water.actor, edges.actor)
    level = None if edges.risk is None else float(edges.risk)
    pilot = Pilot(edges.see, both, settings.radius_margin, level)
    return pilot, {"seed": trained["seed"], "checkpoint": trained["checkpoint"]}


def _at_risk(settings: AnyAgentSettings, risk: float | None) -> AnyAgentSettings:
    if risk is None:
        return settings
    if not risk_levels(settings):
        raise ConfigError("the policy was not trained for risk levels", key="--risk")
    return msgspec.structs.replace(settings, risk=risk)
