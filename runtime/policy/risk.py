"""How cautious a policy is that was trained for every risk level alpha in (0, 1].

At alpha it maximises the mean of the worst share alpha of its returns (CVaR): 1 is the plain mean,
and the smaller, the more it counts what rarely goes wrong.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float32
from twinscrew.runtime.settings import NonNegative, Positive, Settings, convert
from twinscrew.runtime.vessel_description import load_vessel

Level = Annotated[float, Meta(gt=0.0, le=1.0)]


class RiskSettings(Settings, frozen=True):
    """The risk level that a policy is asked with."""

    level: Level | Literal["shipped", "adaptive"] = "shipped"
    """[-] alpha; "shipped": the policy file's own; "adaptive": falls as an object comes near."""
    floor: Level = 0.125
    """[-] "adaptive": alpha where hulls touch."""
    distance_m: Positive = 10.0
    """[m] "adaptive": alpha is 1 where every gap is at least this; two vessel lengths."""
    own_radius_m: NonNegative = load_vessel().radius_m
    """[m] "adaptive": radius of the own hull, half its diagonal."""


def parse_risk(text: str | None) -> RiskSettings:
    """Read a level as it is typed: a number in (0, 1], "adaptive", or nothing.

    Raises
    ------
    ConfigError
        It is none of these.
    """
    if text is None:
        return RiskSettings()
    try:
        return convert({"level": text if text == "adaptive" else float(text)}, RiskSettings)
    except (ValueError, ConfigError) as error:
        allowed = "a number in (0, 1], or adaptive"
        raise ConfigError(f"allowed: {allowed}; got {text!r}", key="--risk") from error


def adaptive_level(objects: Float32, mask: Float32, settings: RiskSettings) -> Float32:
    """Give alpha = floor + (1 - floor) clip(gap / distance, 0, 1), (..., 1), for the nearest hull.

    Parameters
    ----------
    objects : (..., K, 5) float32
        x, y [m], velocity, radius [m] of what is seen, frame B.
    mask : (..., K) float32
        1 where there is an object; without any, alpha is 1.
    settings
        Floor, distance and own radius.
    """
    centre = np.hypot(objects[..., 0], objects[..., 1])
    gap = np.where(mask > 0.0, centre - objects[..., 4] - settings.own_radius_m, np.inf)
    nearest = gap.min(axis=-1, keepdims=True)
    share = np.clip(nearest / settings.distance_m, 0.0, 1.0)
    level: Float32 = (settings.floor + (1.0 - settings.floor) * share).astype(np.float32)
    return level
