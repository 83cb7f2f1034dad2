"""What the doctor looks at: each check is a function that says OK, WARN or FAIL, and what to do."""

from __future__ import annotations

import platform
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType

from twinscrew.runtime.app import checks_machine as machine
from twinscrew.runtime.app.checks_files import Sources, check_files
from twinscrew.runtime.app.checks_network import check_network, check_permissions
from twinscrew.runtime.app.finding import Finding, Verdict, fail, ok
from twinscrew.runtime.errors import TwinscrewError
from twinscrew.runtime.vessel.config import RuntimeConfig, sensor_of

__all__ = ["Finding", "Verdict", "examine"]

PACKAGES = (
    "cryptography",
    "numpy",
    "scipy",
    "filterpy",
    "onnxruntime",
    "eclipse-zenoh",
    "pymavlink",
    "rosbags",
    "mcap",
)


def check_python() -> Finding:
    """Tell the version; the package does not install on one that is too old."""
    return ok("Python", platform.python_version())


def check_packages() -> Finding:
    """Look for everything that the runtime needs."""
    versions, missing = [], []
    for name in PACKAGES:
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            missing.append(name)
    if missing:
        return fail("packages", f"missing: {', '.join(missing)}", "make setup")
    return ok("packages", ", ".join(versions))


def check_native() -> Finding:
    """Load the compiled kernels."""
    try:
        from twinscrew.runtime import _native
    except ImportError as error:
        return fail("native kernels", str(error), "make native")
    return ok("native kernels", Path(str(_native.__file__)).name)


def check_sensor(config: RuntimeConfig) -> Finding:
    """Load the sensor's description."""
    sensor = sensor_of(config)
    rays = f"{len(sensor.elevations)} x {len(sensor.azimuths)} rays"
    return ok("sensor", f"{config.sensor}: {rays}, {sensor.rate_hz:g} Hz")


def check_autopilot_port(config: RuntimeConfig) -> Finding:
    """Open the connection to the autopilot, and close it."""
    from twinscrew.runtime.link.transport import open_transport

    open_transport(config.autopilot.connection).close()
    return ok("autopilot port", config.autopilot.connection)


def check_bus(config: RuntimeConfig) -> Finding:
    """Open Zenoh with these settings, and close it."""
    from twinscrew.runtime.bus.zenoh import ZenohBus

    ZenohBus(config.bus, config.name).close()
    where = ", ".join((*config.bus.connect, *config.bus.listen)) or "no endpoint"
    return ok("Zenoh", f"{config.bus.mode}, {where}")


def examine(config: RuntimeConfig, folder: Path, sources: Sources | None = None) -> list[Finding]:
    """Do every check that needs nothing but this machine; a refusal is a FAIL line.

    With `sources`, the files are compared with their manifest, too.
    """
    checks: list[tuple[str, Callable[[], Finding]]] = [
        ("Python", check_python),
        ("packages", check_packages),
        ("native kernels", check_native),
        ("processor", machine.check_cores),
        ("memory", machine.check_memory),
        ("clock", machine.check_clock),
        ("priority", machine.check_priority),
        ("disk", lambda: machine.check_disk(folder)),
        ("permissions", lambda: check_permissions(config)),
        ("network", lambda: check_network(config)),
        ("sensor", lambda: check_sensor(config)),
        ("policy", lambda: _policy().check_policy(config)),
        ("policy card", lambda: _policy().check_card(config)),
        ("autopilot port", lambda: check_autopilot_port(config)),
        ("Zenoh", lambda: check_bus(config)),
    ]
    if sources is not None:
        checks.append(("files", lambda: check_files(sources)))
    return [_guarded(what, check) for what, check in checks]


def _policy() -> ModuleType:
    """Import what may be missing only now: the line about packages comes first."""
    from twinscrew.runtime.app import checks_policy

    return checks_policy


def _guarded(what: str, check: Callable[[], Finding]) -> Finding:
    try:
        return check()
    except (TwinscrewError, OSError) as error:
        return fail(what, str(error), "put right what the line says")
