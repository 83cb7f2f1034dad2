"""Which learner a configuration names."""

from __future__ import annotations

from typing import Any, TypeAlias

from twinscrew.training.agents.ac_iqn import AcIqn, AcIqnSettings
from twinscrew.training.agents.base import Agent
from twinscrew.training.agents.ddpg import Ddpg, DdpgSettings
from twinscrew.training.agents.dqn import Dqn, DqnSettings
from twinscrew.training.agents.iqn import Iqn, IqnSettings
from twinscrew.training.agents.rainbow import Rainbow, RainbowSettings
from twinscrew.training.agents.sac import Sac, SacSettings

AnyAgentSettings: TypeAlias = (
    AcIqnSettings | IqnSettings | SacSettings | DdpgSettings | RainbowSettings | DqnSettings
)
"""The settings of every learner; the key `algorithm` says of which."""

_LEARNERS: dict[type, type[Agent[Any]]] = {
    AcIqnSettings: AcIqn,
    IqnSettings: Iqn,
    SacSettings: Sac,
    DdpgSettings: Ddpg,
    RainbowSettings: Rainbow,
    DqnSettings: Dqn,
}


def make_agent(settings: AnyAgentSettings, seed: int, device: str) -> Agent[Any]:
    """Build the learner that the settings are of."""
    return _LEARNERS[type(settings)](settings, seed, device)


def risk_levels(settings: AnyAgentSettings) -> int:
    """Give how many risk levels the learner is told of; 0: it has no such input."""
    return settings.risk_levels if isinstance(settings, AcIqnSettings) else 0


def algorithm(settings: AnyAgentSettings) -> str:
    """Give the learner's name, as "ac_iqn"."""
    return str(type(settings).__struct_config__.tag)
