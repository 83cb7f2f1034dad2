"""What the doctor looks at: each check is a function that says OK, WARN or FAIL, and what to do."""

from __future__ import annotations

import os
import platform
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from twinscrew.runtime.app.config import RuntimeConfig, sensor_of
from twinscrew.runtime.errors import TwinscrewError

PACKAGES = (
    "numpy",
    "scipy",
    "filterpy",
    "onnxruntime",
    "eclipse-zenoh",
    "pymavlink",
    "rosbags",
    "mcap",
)
FREE_DISK_GB = 5.0
"""[GB] A day of one vessel's recordings at 1.5 MB/s would be 130 GB; below this, warn."""


class Verdict(Enum):
    """How a check came out."""

    OK = "OK"
    WARN = "WARN"
    FAIL = "FAIL"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the doctor's report."""

    what: str
    verdict: Verdict
    found: str
    advice: str = ""


def check_python() -> Finding:
    """Tell the version; the package does not install on one that is too old."""
    return Finding("Python", Verdict.OK, platform.python_version())


def check_packages() -> Finding:
    """Look for everything that the runtime needs."""
    versions, missing = [], []
    for name in PACKAGES:
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            missing.append(name)
    if missing:
        return Finding("packages", Verdict.FAIL, f"missing: {', '.join(missing)}", "make setup")
    return Finding("packages", Verdict.OK, ", ".join(versions))


def check_native() -> Finding:
    """Load the compiled kernels."""
    try:
        from twinscrew.runtime import _native
    except ImportError as error:
        return Finding("native kernels", Verdict.FAIL, str(error), "make native")
    return Finding("native kernels", Verdict.OK, Path(str(_native.__file__)).name)


def check_cores() -> Finding:
    """Look for cores for the runtime and the rest of the boat."""
    cores = len(os.sched_getaffinity(0))
    load = os.getloadavg()[0]
    found = f"{cores} cores, load {load:.1f}"
    if cores < 2:
        return Finding("processor", Verdict.WARN, found, "give the runtime a core of its own")
    if load > cores:
        return Finding("processor", Verdict.WARN, found, "something else keeps it busy: stop it")
    return Finding("processor", Verdict.OK, found)


def check_clock() -> Finding:
    """Look whether the clock is fine enough and the date believable."""
    resolution_us = time.get_clock_info("monotonic").resolution * 1e6
    year = time.gmtime().tm_year
    found = f"{time.strftime('%Y-%m-%d %H:%M UTC', time.gmtime())}, {resolution_us:g} us steps"
    if year < 2025:
        return Finding("clock", Verdict.WARN, found, "set the date: recordings and signing need it")
    return Finding("clock", Verdict.OK, found)


def check_priority() -> Finding:
    """Ask whether the process may raise its priority."""
    import resource

    soft, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    nice, _ = resource.getrlimit(resource.RLIMIT_NICE)
    if os.geteuid() == 0 or soft > 0 or nice > 20:
        return Finding("priority", Verdict.OK, "real-time or raised priority allowed")
    advice = (
        "let systemd raise it (Nice=, CPUSchedulingPolicy=), or live with it on a quiet machine"
    )
    return Finding("priority", Verdict.WARN, "not allowed to raise it", advice)


def check_disk(folder: Path) -> Finding:
    """Look for room for recordings."""
    place = next(p for p in (folder, *folder.resolve().parents) if p.exists())
    free_gb = shutil.disk_usage(place).free / 1e9
    found = f"{free_gb:.1f} GB free at {place}"
    if not os.access(place, os.W_OK):
        return Finding(
            "disk", Verdict.FAIL, f"{place} cannot be written to", "choose another folder"
        )
    if free_gb < FREE_DISK_GB:
        return Finding("disk", Verdict.WARN, found, "make room, or record elsewhere")
    return Finding("disk", Verdict.OK, found)


def check_sensor(config: RuntimeConfig) -> Finding:
    """Load the sensor's description."""
    sensor = sensor_of(config)
    rays = f"{len(sensor.elevations)} x {len(sensor.azimuths)} rays"
    return Finding("sensor", Verdict.OK, f"{config.sensor}: {rays}, {sensor.rate_hz:g} Hz")


def check_policy(config: RuntimeConfig) -> Finding:
    """Load the policy, and ask it the same thing twice."""
    import numpy as np

    from twinscrew.runtime.app.assemble import expected_of_policies
    from twinscrew.runtime.messages.types import OBSERVED_OBJECTS, Observation
    from twinscrew.runtime.policy.load import load_policy

    policy = load_policy(config.policy, expected_of_policies(config), config.risk)
    blank = Observation(
        ego=np.array([20, 0, 0, 0, 0, 0, 0], dtype=np.float32),
        objects=np.zeros((OBSERVED_OBJECTS, 5), dtype=np.float32),
        mask=np.zeros(OBSERVED_OBJECTS, dtype=np.float32),
    )
    first, second = policy.act(blank), policy.act(blank)
    found = f"{policy.name}, a decision every {policy.period_s:g} s"
    if not np.array_equal(first, second):
        return Finding("policy", Verdict.FAIL, f"{found}; answers differ", "use another policy")
    return Finding("policy", Verdict.OK, found)


def check_autopilot_port(config: RuntimeConfig) -> Finding:
    """Open the connection to the autopilot, and close it."""
    from twinscrew.runtime.link.transport import open_transport

    open_transport(config.autopilot.connection).close()
    return Finding("autopilot port", Verdict.OK, config.autopilot.connection)


def check_bus(config: RuntimeConfig) -> Finding:
    """Open Zenoh with these settings, and close it."""
    from twinscrew.runtime.bus.zenoh import ZenohBus

    ZenohBus(config.bus, config.name).close()
    where = ", ".join((*config.bus.connect, *config.bus.listen)) or "no endpoint"
    return Finding("Zenoh", Verdict.OK, f"{config.bus.mode}, {where}")


def examine(config: RuntimeConfig, folder: Path) -> list[Finding]:
    """Do every check that needs nothing but this machine; a refusal is a FAIL line."""
    checks: list[tuple[str, Callable[[], Finding]]] = [
        ("Python", check_python),
        ("packages", check_packages),
        ("native kernels", check_native),
        ("processor", check_cores),
        ("clock", check_clock),
        ("priority", check_priority),
        ("disk", lambda: check_disk(folder)),
        ("sensor", lambda: check_sensor(config)),
        ("policy", lambda: check_policy(config)),
        ("autopilot port", lambda: check_autopilot_port(config)),
        ("Zenoh", lambda: check_bus(config)),
    ]
    return [_guarded(what, check) for what, check in checks]


def _guarded(what: str, check: Callable[[], Finding]) -> Finding:
    try:
        return check()
    except (TwinscrewError, OSError) as error:
        return Finding(what, Verdict.FAIL, str(error), "put right what the line says")
