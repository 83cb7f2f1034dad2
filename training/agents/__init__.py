"""The learning algorithms, one file each.

A new one is a file beside these, and a line in `AGENTS` (and in the type of its settings).
"""

from __future__ import annotations

from typing import Any, TypeAlias

from twinscrew.training.agents.ac_iqn import AcIqn, AcIqnSettings
from twinscrew.training.agents.base import Agent
from twinscrew.training.agents.ddpg import Ddpg, DdpgSettings
from twinscrew.training.agents.dqn import Dqn, DqnSettings
from twinscrew.training.agents.iqn import Iqn, IqnSettings
from twinscrew.training.agents.ppo import Ppo, PpoSettings
from twinscrew.training.agents.rainbow import Rainbow, RainbowSettings
from twinscrew.training.agents.sac import Sac, SacSettings

AGENTS: dict[type, type[Agent[Any]]] = {
    AcIqnSettings: AcIqn,
    IqnSettings: Iqn,
    SacSettings: Sac,
    DdpgSettings: Ddpg,
    RainbowSettings: Rainbow,
    DqnSettings: Dqn,
    PpoSettings: Ppo,
}
AnyAgentSettings: TypeAlias = (
    AcIqnSettings
    | IqnSettings
    | SacSettings
    | DdpgSettings
    | RainbowSettings
    | DqnSettings
    | PpoSettings
)
"""The settings of every learner; the key `algorithm` says of which."""


def make_agent(settings: AnyAgentSettings, seed: int, device: str = "cpu") -> Agent[Any]:
    """Build the learner that the settings are of."""
    return AGENTS[type(settings)](settings, seed, device)


def risk_levels(settings: AnyAgentSettings) -> int:
    """Give how many risk levels the learner takes as an input; 0: it has no such input."""
    return settings.risk_levels if isinstance(settings, AcIqnSettings) else 0


def algorithm(settings: AnyAgentSettings) -> str:
    """Give the learner's name, as "ac_iqn"."""
    return str(type(settings).__struct_config__.tag)
