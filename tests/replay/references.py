"""Stored references: what the core once decided on a recording, and on which machine.

The recording is one vessel's of two that cross in the paper's sea. The references lie beside it,
one a case, as decisions to the last bit; `python -m tests.replay.accept` renews them.
"""

from __future__ import annotations

import hashlib
import platform
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import structs

from twinscrew.hil_sim.scenario import Scenario, load_scenario
from twinscrew.hil_sim.sensors.marine import (
    OWN_MMSI,
    AisTransponders,
    MarineSettings,
    RadarUnit,
)
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.hil_sim.sitl_runtimes import DATUM
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.files import processor
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recorder import software
from twinscrew.runtime.recording.recording import Recording, find_recordings
from twinscrew.runtime.recording.settings import BagSettings
from twinscrew.runtime.recording.writer import BagWriter
from twinscrew.runtime.vessel.config import RuntimeConfig, config_for
from twinscrew.runtime.vessel.summary import metadata_of
from twinscrew.runtime.vessel.vessel import vessel_for_replay

FOLDER = Path(__file__).parent.parent / "data" / "references" / "crossing"
VESSEL = "wamv1"
LASTS_S = 3.0
SHIP_LASTS_S = 6.0
NEARER_M = 12.0
"""[m] Than in the shipped scenario, so that each has the other in sight."""
PACKED = BagSettings(compression="zstd", chunk_kb=4096)

ANXIOUS = {"wait_s": 1.5, "moving_horizon_s": 4.0, "margin_m": 4.0}
"""Intervenes where the policy has all in hand, so that the assurance is part of a reference."""


def near(**values: Any) -> RuntimeConfig:
    """Give the vessel of the references: it sees 20 m far, and follows long ships in pieces."""
    return config_for(
        "wam_v",
        name=VESSEL,
        sensor="vrx16",
        perception={"max_range_m": 20.0},
        tracking={
            "measurement": {
                "range_m": [7.2, 10.0, 16.5, 19.5],
                "depth_m": [0.02, 0.48, 0.45, 1.0],
                "edge_m": 17.0,
            },
            "ships": {"longest_m": 0.0},
        },
        observation={"perception_range_m": 20.0},
        **values,
    )


CASES: Mapping[str, RuntimeConfig] = {
    "ac_iqn": near(policy="ac_iqn"),
    "ac_iqn_wam_v": near(policy="ac_iqn_wam_v"),
    "apf": near(policy="apf"),
    "assured": near(policy="ac_iqn_wam_v", assurance=ANXIOUS),
    "senses": near(
        policy="ac_iqn_wam_v",
        senses={"ais": {"datum": DATUM, "own_mmsi": OWN_MMSI}, "radar": {}},
    ),
}
RECORDINGS: Mapping[str, str] = {"senses": "ship"}
"""The recording of a case that is not decided on the one in `inputs`: AIS and radar are in it."""


@dataclass(frozen=True, slots=True)
class Reference:
    """What was decided when the reference was made."""

    decisions: tuple[bytes, ...]
    machine: Mapping[str, Any]
    """What the bits may depend on, besides the source."""


def inputs(folder: Path = FOLDER, case: str = "") -> Recording:
    """Give what the core took in, of a case."""
    (recording,) = find_recordings(folder / RECORDINGS.get(case, "inputs"))
    return recording


def decide(case: str) -> tuple[bytes, ...]:
    """Decide on the recording, with the source as it is."""
    return tuple(_decisions(case))


def sha256(decisions: tuple[bytes, ...]) -> str:
    """Give the hash of a run, as `twinscrew replay` does."""
    from twinscrew.runtime.recording.recording import decisions_sha256

    return decisions_sha256(decisions)


def stored(case: str, folder: Path = FOLDER) -> Reference | None:
    """Read a reference; None if there is none."""
    if not (folder / case).is_dir():
        return None
    (recording,) = find_recordings(folder / case)
    return Reference(tuple(recording.decisions()), recording.metadata["machine"])


def store(case: str, decisions: tuple[bytes, ...], folder: Path = FOLDER) -> None:
    """Put a reference in place of the old one, if there is one."""
    shutil.rmtree(folder / case, ignore_errors=True)
    policy = vessel_for_replay(CASES[case]).pipeline.policy
    metadata = {"machine": machine(), **metadata_of(CASES[case], policy)}
    bag = BagWriter(folder / case, VESSEL, metadata, PACKED)
    for payload in decisions:
        bag.write("decision", payload, cdr.decode_decision(payload).stamp_ns)
    bag.close()


def record(folder: Path = FOLDER) -> None:
    """Sail, and keep what one vessel's core took in: the references must then be renewed."""
    crossing = load_scenario("crossing")
    heading = crossing.starts[:, 2]
    ahead = NEARER_M * np.column_stack([np.cos(heading), np.sin(heading), np.zeros(2)])
    crossing = replace(crossing, starts=crossing.starts + ahead, time_limit_s=LASTS_S)
    _record(crossing, SitlSettings(sensor="vrx16", lockstep=True), folder / "inputs")


def record_ship(folder: Path = FOLDER) -> None:
    """Sail towards a ship that reports itself, with a radar, until the LiDAR has seen it."""
    scenario = load_scenario("ship_crossing")
    ship = structs.replace(scenario.traffic[0], start_m=(22.0, 86.0))
    scenario = replace(scenario, traffic=(ship,), time_limit_s=SHIP_LASTS_S)
    marine = MarineSettings(ais=AisTransponders(loss=0.0), radar=RadarUnit())
    settings = SitlSettings(sensor="vrx16", lockstep=True, marine=marine)
    _record(scenario, settings, folder / RECORDINGS["senses"])


def _record(scenario: Scenario, settings: SitlSettings, kept: Path) -> None:
    shutil.rmtree(kept, ignore_errors=True)
    with tempfile.TemporaryDirectory() as run:
        sail(scenario, settings, Path(run))
        (recording,) = find_recordings(Path(run) / VESSEL)
        bag = BagWriter(kept, VESSEL, {"software": software()}, PACKED)
        for message in recording.inputs():
            bag.write(*message)
        bag.close()


def machine() -> dict[str, Any]:
    """Say what the bits may depend on, besides the source: processor, C library, packages."""
    words = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    line = next(line for line in words if line.startswith(("flags", "Features")))
    flags = line.partition(":")[2].strip()
    return {
        "cpu": processor(),
        "cpu_flags_sha256": hashlib.sha256(flags.encode()).hexdigest(),
        "architecture": platform.machine(),
        "libc": " ".join(platform.libc_ver()),
        "python": platform.python_version(),
        "software": {k: v for k, v in software().items() if k != "twinscrew"},
    }


def _decisions(case: str) -> Iterator[bytes]:
    vessel = vessel_for_replay(CASES[case])
    for message in inputs(case=case).inputs():
        out = vessel.handle(Received(message.topic, message.payload, 0), 0.0)
        if out.decision is not None:
            yield cdr.encode_decision(out.decision)
