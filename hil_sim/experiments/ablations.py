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
from twinscrew.hil_sim.vessel.dynamics import DynamicsSettings, as_vrx
from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.safety.assurance import AssuranceSettings
from twinscrew.runtime.settings import CONFIG_DIR

ABLATIONS = {
    "ideal_perception": "the tracker is given the true centres and radii of what is in range",
    "ideal_tracking": "the policy is given the true centres, radii and velocities",
    "no_wind": "no wind",
    "no_waves": "flat water",
    "no_assurance": "the policy's thrust goes to the propellers unchecked, as in the paper",
    "ideal_thrust": "commands reach the propellers as they are, not as the autopilot's pulses",
    "training_vessel": "mass, inertia, drag and thrusters of the training environment",
    "as_vrx": "VRX's own physics: wind coefficients along the world's axes, steps of 50 ms",
    "goal_4m": "a goal is reached within 4 m, as the authors' code has it for APF and MPC",
    "vanish": "vessels leave the map at their goals, as in training",
}
"""What each switch does."""
PRESETS = {
    "gap": (
        "no_assurance",
        "ideal_perception",
        "ideal_tracking",
        "no_wind",
        "no_waves",
        "ideal_thrust",
        "training_vessel",
        "vanish",
    )
}
"""Switches by one name: `gap` is all that training does not have."""
FULL = "full"
"""The simulator as it is."""
Switches = tuple[str, ...]


def parse_ablations(text: str, key: str = "--ablate") -> Switches:
    """Read switches as people type them: names with commas between them, `gap` for many."""
    parts = [part.strip() for part in text.split(",") if part.strip()]
    names = tuple(dict.fromkeys(name for part in parts for name in PRESETS.get(part, (part,))))
    for name in names:
        if name not in ABLATIONS:
            raise ConfigError(one_of(name, (*ABLATIONS, *PRESETS)), key=key)
    return names


def variants(switches: Switches, base: Switches = ()) -> tuple[Switches, ...]:
    """Give what is sailed: the base, every switch alone with it, then all of them at once.

    The base is the full simulator, or what its switches leave of it.
    """
    added = tuple(switch for switch in switches if switch not in base)
    together = (added,) if len(added) > 1 else ()
    return tuple((*base, *some) for some in ((), *((switch,) for switch in added), *together))


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


def dynamics(switches: Switches) -> DynamicsSettings:
    """Say whose physics it is."""
    return as_vrx() if "as_vrx" in switches else DynamicsSettings()


def eased(scenario: Scenario, switches: Switches) -> Scenario:
    """Widen the goals."""
    return replace(scenario, goal_radius=4.0) if "goal_4m" in switches else scenario


def unassured(settings: AssuranceSettings, switches: Switches) -> AssuranceSettings:
    """Let the policy's commands pass unchecked."""
    return structs.replace(settings, enabled=False) if "no_assurance" in switches else settings


def supervision(switches: Switches) -> SupervisorSettings:
    """Say what becomes of a vessel that has arrived."""
    return SupervisorSettings(after_goal="vanish" if "vanish" in switches else "hold")
