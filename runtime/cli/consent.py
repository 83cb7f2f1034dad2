"""`twinscrew consent`: an operator's word that a boat may be armed, once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def consent(
    config: Annotated[Path, typer.Option(help="The vessel's TOML file.")],
) -> None:
    """Let the next start of `run` within ten minutes ask for arming, as `arm = true` says.

    Exit status 2 if the configuration does not say so: then nobody but a pilot arms the boat.
    """
    from twinscrew.runtime.errors import ConfigError
    from twinscrew.runtime.vessel.config import load_config
    from twinscrew.runtime.vessel.consent import LASTS_S, give, place_of

    settings = load_config(config)
    if not settings.autopilot.arm:
        raise ConfigError("is false: no start asks for arming", file=config, key="autopilot.arm")
    place = place_of(config, settings.autopilot.consent_file)
    give(place)
    print(f"{place}: the next start of {settings.name} within {LASTS_S:g} s may arm the boat")
