"""Switches that make the simulator simpler, one by one, to see which of them explains a gap.

The training environment is simpler than the simulator in perception, sea and dynamics. With a
switch on, one of these differences is gone; what the success rate gains by it, the difference cost.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from msgspec import structs

from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.sea.sea import SeaSettings
from twinscrew.hil_sim.supervisor import SupervisorSettings
from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.safety.assurance import AssuranceSettings
from twinscrew.runtime.settings import CONFIG_DIR

ABLATIONS = {
    "ideal_perception": "the tracker is given the true centres and radii of what is in range",
    "ideal_tracking": "the policy is given the true centres, radii and velocities",
    "no_wind": "no wind",
    "no_waves": "flat water",
    "no_assurance": "the policy's thrust goes to the propellers unchecked, as in the paper",
    "training_vessel": "mass, inertia, drag and thrusters of the training environment",
    "goal_4m": "a goal is reached within 4 m, as the authors' code has it for APF and MPC",
    "vanish": "vessels leave the map at their goals, as in training",
}
"""What each switch does."""
FULL = "full"
"""The simulator as it is."""
Switches = tuple[str, ...]


def parse_ablations(text: str) -> Switches:
    """Read switches as people type them: names with commas between them."""
    names = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    for name in names:
        if name not in ABLATIONS:
            raise ConfigError(one_of(name, ABLATIONS), key="--ablate")
    return names


def variants(switches: Switches) -> tuple[Switches, ...]:
    """Give what is sailed: the full simulator, every switch alone, then all of them at once."""
    alone = tuple((switch,) for switch in switches)
    return ((), *alone, switches) if len(switches) > 1 else ((), *alone)


def label(switches: Iterable[str]) -> str:
    """Give a variant's name, as "full" or "no_wind+no_waves"."""
    return "+".join(switches) or FULL


def calmed(sea: SeaSettings, switches: Switches) -> SeaSettings:
    """Take wind or waves away."""
    if "no_wind" in switches:
        wind = structs.replace(sea.wind, mean_mps=0.0, gust_mps=0.0)
        sea = structs.replace(sea, wind=wind)
    if "no_waves" in switches:
        sea = structs.replace(sea, waves=structs.replace(sea.waves, gain=0.0))
    return sea


def vessel_of(switches: Switches) -> str:
    """Name the vessel that sails."""
    trained = CONFIG_DIR / "experiments" / "training_vessel.toml"
    return str(trained) if "training_vessel" in switches else "wam_v"


def eased(scenario: Scenario, switches: Switches) -> Scenario:
    """Widen the goals."""
    return replace(scenario, goal_radius=4.0) if "goal_4m" in switches else scenario


def unassured(settings: AssuranceSettings, switches: Switches) -> AssuranceSettings:
    """Let the policy's commands pass unchecked."""
    return structs.replace(settings, enabled=False) if "no_assurance" in switches else settings


def supervision(switches: Switches) -> SupervisorSettings:
    """Say what becomes of a vessel that has arrived."""
    return SupervisorSettings(after_goal="vanish" if "vanish" in switches else "hold")
