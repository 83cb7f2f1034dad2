"""Voyages in the full simulator, with the assurance or without, of any policy: a random one too."""

from __future__ import annotations

from dataclasses import dataclass, replace

from msgspec import structs

from twinscrew.hil_sim.drivers.lockstep import LockstepCrew
from twinscrew.hil_sim.drivers.voyage import Voyage
from twinscrew.hil_sim.experiments.chance import RandomPolicy
from twinscrew.hil_sim.scenario import Scenario, load_scenario
from twinscrew.hil_sim.supervisor import Result
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.link.ardupilot.link import AutopilotSettings
from twinscrew.runtime.messages.types import Decision
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.safety.assurance import AssuranceSettings
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel.mission import MissionSettings
from twinscrew.runtime.vessel.pipeline import Fault, Pipeline, make_pipeline

SENSOR = "vrx32"


@dataclass(frozen=True, slots=True)
class Episode:
    """How one episode went."""

    seed: int
    results: tuple[Result, ...]
    interventions: int
    """[-] Manoeuvres begun, or taking over from another, over all vessels."""
    released_after_s: tuple[float, ...]
    """[s] How long each intervention lasted."""


def sail(
    vessels: int,
    buoys: int,
    seed: int,
    *,
    policy: str,
    assurance: AssuranceSettings,
    limit_s: float | None = None,
) -> Episode:
    """Sail one of the paper's random episodes in lock-step.

    Parameters
    ----------
    policy
        "random", or what a runtime's configuration names.
    limit_s
        Time limit [s]; the scenario's by default.
    """
    scenario = load_scenario("random", vessels, buoys, seed)
    if limit_s is not None:
        scenario = replace(scenario, time_limit_s=limit_s)
    world = make_world(scenario, sensor=SENSOR, seed=seed)
    configs = [_config(scenario, i, policy, assurance) for i in range(vessels)]
    pipelines = [
        make_pipeline(config, policy=RandomPolicy((seed, index)) if policy == "random" else None)
        for index, config in enumerate(configs)
    ]
    told = [_listen(pipeline) for pipeline in pipelines]
    crew = LockstepCrew(configs, epoch_ns=world.epoch_ns, pipelines=pipelines)
    scan_s = 1.0 / load_sensor(SENSOR).rate_hz
    results = Voyage(world, crew, scan_s=scan_s).run().results
    events = [event for decisions in told for decision in decisions for event in decision.events]
    names = [event.name for event in events]
    lasted = [event.detail for event in events if event.name == "assurance_released"]
    return Episode(
        seed,
        results,
        names.count("assurance_intervened"),
        tuple(float(detail.split()[1]) for detail in lasted),
    )


def _config(
    scenario: Scenario, index: int, policy: str, assurance: AssuranceSettings
) -> RuntimeConfig:
    return RuntimeConfig(
        name=scenario.names[index],
        sensor=SENSOR,
        policy="apf" if policy == "random" else policy,  # replaced before it is asked
        mission=MissionSettings(goal_radius_m=scenario.goal_radius),
        autopilot=AutopilotSettings(system_id=index + 1, arm=True, receiver_fitted=False),
        assurance=structs.replace(assurance),
    )


def _listen(pipeline: Pipeline) -> list[Decision]:
    """Keep every decision that the pipeline makes."""
    decisions: list[Decision] = []
    step = pipeline.step

    def listened(*arguments: object, **named: object) -> tuple[Decision, Fault | None]:
        decision, fault = step(*arguments, **named)  # type: ignore[arg-type]
        decisions.append(decision)
        return decision, fault

    pipeline.step = listened  # type: ignore[method-assign]
    return decisions
