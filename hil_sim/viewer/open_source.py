"""From what a person types to what the page shows."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from msgspec import structs

from twinscrew.hil_sim.viewer.live import Boat, LiveSource
from twinscrew.hil_sim.viewer.recorded import RecordedSource
from twinscrew.hil_sim.viewer.scene import Scene, read_scene
from twinscrew.runtime.app.config import load_config, sensor_of
from twinscrew.runtime.bus.zenoh_config import ZenohSettings
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.perception.sensor import load_sensor

RUN_WAIT_S = 20.0
"""[s] How long a run may take to begin."""
POLL_S = 0.1
CONFIG_FILE = "runtime.toml"
"""What `sitl` calls a vessel's configuration."""


def from_endpoint(endpoint: str, names: str, sensor: str) -> LiveSource:
    """Look at boats whose Zenoh endpoint is known.

    Raises
    ------
    BusError
        Nobody is there.
    ConfigError
        No name is given, or the sensor does not exist.
    """
    listed = tuple(name.strip() for name in names.split(",") if name.strip())
    if not listed:
        raise ConfigError("name at least one vessel", key="--names")
    boats = [Boat(name, load_sensor(sensor)) for name in listed]
    return LiveSource(ZenohSettings(mode="client", connect=(endpoint,), node=""), boats, Scene())


def from_configs(files: Sequence[Path], scene: Scene | None = None) -> LiveSource:
    """Look at boats by their own configuration: their bus's security and keys are used too.

    Raises
    ------
    BusError
        Nobody is there.
    ConfigError
        A file cannot be used.
    """
    configs = [load_config(file) for file in files]
    boats = [Boat(config.name, sensor_of(config)) for config in configs]
    settings = structs.replace(configs[0].bus, mode="client", listen=())
    return LiveSource(settings, boats, scene or Scene())


def from_run(folder: Path) -> LiveSource:
    """Look at a run that `sitl` is sailing, or is about to.

    Raises
    ------
    ConfigError
        It does not begin.
    """
    scene = read_scene(folder)
    names = scene.names or tuple(
        sorted(path.parent.name for path in folder.glob(f"*/{CONFIG_FILE}"))
    )
    files = [folder / name / CONFIG_FILE for name in names]
    deadline_s = time.monotonic() + RUN_WAIT_S
    while not files or not all(file.is_file() and file.stat().st_size for file in files):
        if time.monotonic() > deadline_s or not files:
            raise ConfigError("no run in real time has begun here", file=folder)
        time.sleep(POLL_S)
    return from_configs(files, scene)


def from_recording(path: Path, mapping: Path | None) -> RecordedSource:
    """Show a recording; errors as `RecordedSource`."""
    return RecordedSource(path, mapping)
