"""What a page is told once: who is there, what stands still, how large things are."""

from __future__ import annotations

from typing import Any

import msgspec

from twinscrew.hil_sim.viewer.source import Source
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.policy.colregs import ColregsSettings

VERSION = 1
"""[-] Of what goes over the wire; a page of another version reloads itself."""


def greeting(source: Source) -> dict[str, Any]:
    """Give the greeting: the page itself knows no number about boats."""
    defaults = RuntimeConfig()
    return {
        "version": VERSION,
        "mode": source.mode,
        "names": list(source.names),
        "duration_s": round(source.duration_s, 2),
        "scene": msgspec.to_builtins(source.scene),
        "trails": source.trails(),
        "hull": msgspec.to_builtins(defaults.perception.hull),
        "thrust": msgspec.to_builtins(defaults.thrust),
        "goal_radius_m": source.scene.goal_radius_m or defaults.mission.goal_radius_m,
        "zones": msgspec.to_builtins(ColregsSettings()),
    }
