"""Which learner a configuration names."""

from __future__ import annotations

from typing import Any, TypeAlias

from twinscrew.training.agents.ac_iqn import AcIqn, AcIqnSettings
from twinscrew.training.agents.base import Agent

AnyAgentSettings: TypeAlias = AcIqnSettings
"""The settings of every learner; the key `algorithm` says of which."""


def make_agent(settings: AnyAgentSettings, seed: int, device: str) -> Agent[Any]:
    """Build the learner that the settings are of."""
    return AcIqn(settings, seed, device)


def algorithm(settings: AnyAgentSettings) -> str:
    """Give the learner's name, as "ac_iqn"."""
    return str(type(settings).__struct_config__.tag)
