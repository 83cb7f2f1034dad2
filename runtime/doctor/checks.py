"""What the doctor looks at: each check is a function that says OK, WARN or FAIL, and what to do."""

from __future__ import annotations

import ctypes
import grp
import json
import os
import platform
import pwd
import re
import shutil
import socket
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points, version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from twinscrew.runtime.charts.chart import read_chart
from twinscrew.runtime.errors import ConfigError, TwinscrewError
from twinscrew.runtime.policy.observation import nothing_seen
from twinscrew.runtime.settings import shipped
from twinscrew.runtime.vessel.approval import load_approved
from twinscrew.runtime.vessel.config import RuntimeConfig, datum_of, sensor_of
from twinscrew.runtime.vessel.vessel import chart_of
from twinscrew.runtime.vessel_description import load_vessel

if TYPE_CHECKING:
    from twinscrew.runtime.policy.load import Policy
    from twinscrew.runtime.policy.onnx import OnnxPolicy


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
    """What to do about it; empty if all is well."""


def ok(what: str, found: str) -> Finding:
    """Say that all is well."""
    return Finding(what, Verdict.OK, found)


def warn(what: str, found: str, advice: str) -> Finding:
    """Say that it works, but not as well as it should."""
    return Finding(what, Verdict.WARN, found, advice)


def fail(what: str, found: str, advice: str) -> Finding:
    """Say that a boat cannot sail like this."""
    return Finding(what, Verdict.FAIL, found, advice)


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
    "shapely",
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


def check_chart(config: RuntimeConfig) -> Finding:
    """Read the chart as the runtime does; say what it forbids, and what of it was left out."""
    chart, read = chart_of(config), read_chart(config.chart, datum_of(config))
    if not read.features:
        return ok("chart", "none: nothing is known of land, shallow water or keep-out areas")
    kinds = Counter(feature.kind for feature in read.features)
    found = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    found += f"; {len(chart.edges)} edges, safety depth {chart.safety_depth_m:g} m"
    if read.ignored:
        found += f"; forbids nothing: {', '.join(sorted(read.ignored))}"
    if read.repaired:
        found += f"; {read.repaired} outlines repaired"
    if read.far:
        advice = "cut the chart to the water where the boat sails"
        return warn("chart", f"{found}; {read.far} features are too far away, left out", advice)
    why = chart.why(np.zeros(2))
    if why:
        return warn(
            "chart", f"{found}; the origin of frame N is {why}", "is autopilot.datum right?"
        )
    return ok("chart", found)


def check_autopilot_port(config: RuntimeConfig) -> Finding:
    """Open the connection to the autopilot, and close it."""
    from twinscrew.runtime.link.autopilot import make_autopilot

    make_autopilot(config.autopilot).open(lambda: True).close()
    return ok("autopilot port", config.autopilot.connection)


def check_bus(config: RuntimeConfig) -> Finding:
    """Open Zenoh with these settings, and close it."""
    from twinscrew.runtime.bus.zenoh import ZenohBus

    ZenohBus(config.bus, config.name).close()
    where = ", ".join((*config.bus.connect, *config.bus.listen)) or "no endpoint"
    return ok("Zenoh", f"{config.bus.mode}, {where}")


# -- What the doctor looks at of the computer: processor, memory, clock, priority, disk.

FREE_DISK_GB: Final = 5.0
"""[GB] A day of one vessel's recordings at 1.5 MB/s would be 130 GB; below this, warn."""
FREE_MEMORY_MB: Final = 600.0
"""[MB] What the systemd unit allows the runtime (MemoryMax)."""
CLOCK_ERROR_MS: Final = 50.0
"""[ms] A clock known no better than this: half a scan."""
SYSTEM: Final = Path("/sys/devices/system/cpu")
MEMORY: Final = Path("/proc/meminfo")


def check_cores() -> Finding:
    """Look for cores for the runtime and the rest of the boat, and how fast they may run."""
    cores = len(os.sched_getaffinity(0))
    load = os.getloadavg()[0]
    found = f"{cores} cores, load {load:.1f}"
    if cores < 2:
        return warn("processor", found, "give the runtime a core of its own")
    if load > cores:
        return warn("processor", found, "something else keeps it busy: stop it")
    if governors := _governors() & {"powersave", "conservative"}:
        slow = f"{found}, governor {', '.join(sorted(governors))}"
        return warn("processor", slow, "cpupower frequency-set -g performance")
    return ok("processor", found)


def check_memory() -> Finding:
    """Look for memory that is free."""
    lines = dict(line.split(":") for line in MEMORY.read_text().splitlines())
    free_mb = int(lines["MemAvailable"].split()[0]) / 1024.0
    found = f"{free_mb:.0f} MB free"
    if free_mb < FREE_MEMORY_MB:
        return warn("memory", found, f"the runtime may take {FREE_MEMORY_MB:.0f} MB: stop others")
    return ok("memory", found)


def check_clock() -> Finding:
    """Look whether the date is believable, and whether anything keeps the clock right."""
    found = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
    if time.gmtime().tm_year < 2025:
        return warn("clock", found, "set the date: recordings and signing need it")
    error_ms = clock_error_ms()
    if error_ms is None:
        return warn(
            "clock",
            f"{found}, kept by nobody",
            "chrony or timesyncd, from GPS or a server: other computers' stamps must agree",
        )
    found = f"{found}, right to {error_ms:.1f} ms"
    if error_ms > CLOCK_ERROR_MS:
        return warn("clock", found, "wait for it to settle, or use a nearer time server")
    return ok("clock", found)


def clock_error_ms() -> float | None:
    """Ask the kernel how wrong its clock may be (adjtimex(2)) [ms]; None: it does not know."""
    words = (ctypes.c_long * 32)()  # struct timex; its first word, `modes`, is 0: only ask
    if ctypes.CDLL(None, use_errno=True).adjtimex(words) < 0:
        return None
    max_error_us, status = words[3], words[5] & 0xFFFFFFFF
    unsynchronised = 0x40  # STA_UNSYNC
    return None if status & unsynchronised else max_error_us / 1e3


def check_priority() -> Finding:
    """Ask whether the process may raise its priority."""
    import resource

    soft, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    nice, _ = resource.getrlimit(resource.RLIMIT_NICE)
    if os.geteuid() == 0 or soft > 0 or nice > 20:
        return ok("priority", "real-time or raised priority allowed")
    advice = "let systemd raise it (LimitRTPRIO=, Nice=), or live with it on a quiet machine"
    return warn("priority", "not allowed to raise it", advice)


def check_disk(folder: Path) -> Finding:
    """Look for room for recordings."""
    place = next(p for p in (folder, *folder.resolve().parents) if p.exists())
    free_gb = shutil.disk_usage(place).free / 1e9
    found = f"{free_gb:.1f} GB free at {place}"
    if not os.access(place, os.W_OK):
        return fail("disk", f"{place} cannot be written to", "choose another folder")
    if free_gb < FREE_DISK_GB:
        return warn("disk", found, "make room, or record elsewhere")
    return ok("disk", found)


def _governors() -> set[str]:
    files = SYSTEM.glob("cpu[0-9]*/cpufreq/scaling_governor")
    return {file.read_text().strip() for file in files}


# -- What the doctor looks at of the connections: endpoints, devices and files a boat needs.

WAIT_S: Final = 1.0
"""[s] How long somebody may take to answer a call on a boat's own network."""
ENDPOINT: Final = re.compile(r"(tcp|tls|udp|quic)/(\[[^\]]+\]|[^:/]+):(\d+)")
"""Zenoh's locators, as tcp/10.0.0.5:7447."""


class Endpoint(NamedTuple):
    """Where somebody listens."""

    kind: str
    host: str
    port: int


def endpoint_of(locator: str) -> Endpoint | None:
    """Read a Zenoh locator; None if it is of a kind that cannot be called by hand."""
    match = ENDPOINT.match(locator)
    return None if match is None else Endpoint(match[1], match[2].strip("[]"), int(match[3]))


def check_network(config: RuntimeConfig) -> Finding:
    """Call every Zenoh endpoint that the boat is to connect to."""
    called, silent = [], []
    for locator in config.bus.connect:
        endpoint = endpoint_of(locator)
        if endpoint is None or endpoint.kind not in {"tcp", "tls"}:
            continue
        problem = _call(endpoint)
        called.append(locator)
        if problem:
            silent.append(f"{locator}: {problem}")
    if silent:
        advice = "start what should listen there (bridge, router, sensors); look at the firewall"
        return fail("network", "; ".join(silent), advice)
    if not called:
        return ok("network", "no endpoint to call")
    return ok("network", f"somebody answers at {', '.join(called)}")


def _call(endpoint: Endpoint) -> str:
    """Try to connect; give what went wrong."""
    try:
        socket.create_connection((endpoint.host, endpoint.port), WAIT_S).close()
    except OSError as error:
        return str(error.strerror or error)
    return ""


def check_permissions(config: RuntimeConfig) -> Finding:
    """Look whether this user may use the devices and read the files that are named."""
    user = _user()
    wanting = [
        f"{path}: {problem}"
        for path, mode in _needed(config)
        if (problem := _refusal(path, mode)) is not None
    ]
    if wanting:
        advice = "the serial line's group is usually dialout: usermod -a -G dialout USER"
        return fail("permissions", f"{user}: {'; '.join(wanting)}", advice)
    if os.geteuid() == 0:
        return warn("permissions", f"{user}: everything", "on a boat run it as a user of its own")
    return ok("permissions", user)


def _needed(config: RuntimeConfig) -> list[tuple[Path, int]]:
    """Give the devices and files, and what is to be done with them."""
    needed = []
    if config.bus.config_file is not None:
        needed.append((Path(config.bus.config_file), os.R_OK))
    line = config.autopilot.connection.removeprefix("serial:")
    if line.startswith("/"):
        needed.append((Path(line.partition(":")[0]), os.R_OK | os.W_OK))
    return needed


def _refusal(path: Path, mode: int) -> str | None:
    if not path.exists():
        return "is not there"
    if os.access(path, mode):
        return None
    group = grp.getgrgid(path.stat().st_gid).gr_name
    return f"may not be {'used' if mode & os.W_OK else 'read'}; it is of group {group}"


def _user() -> str:
    try:
        return pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return f"user {os.geteuid()}"


# -- What the doctor looks at of the files: whether they are the approved ones.


@dataclass(frozen=True, slots=True)
class Sources:
    """What `run` would be given."""

    config: Path
    manifest: Path | None = None
    public_key: Path | None = None


def check_files(sources: Sources) -> Finding:
    """Compare every file with the manifest, if there is one, as `run` would."""
    try:
        approval = load_approved(sources.config, sources.manifest, sources.public_key).approval
    except ConfigError as error:
        advice = "look at who changed it; approve it anew by `twinscrew manifest write`"
        return fail("files", str(error), advice)
    if approval is None:
        return ok("files", "no manifest: nobody would notice a changed file")
    return ok("files", str(approval))


# -- What the doctor looks at of the policy: that it answers, and what is known of it.

SAME = ("training_run", "commit", "created")
"""What a policy file and its card must agree on."""
WORTHY = 0.9
"""[-] A policy that fails oftener than this in one of the paper's settings is worth a warning."""


def _policy_of(config: RuntimeConfig) -> Policy:
    from twinscrew.runtime.policy.load import load_policy  # may be missing: `packages` says so
    from twinscrew.runtime.vessel.pipeline import expected_of_policies

    vessel = load_vessel(config.vessel)
    return load_policy(config.policy, expected_of_policies(config), config.risk, vessel)


def check_policy(config: RuntimeConfig) -> Finding:
    """Load the policy, and ask it the same thing twice."""
    policy = _policy_of(config)
    blank = nothing_seen(policy.shown)
    blank.ego[0] = 20.0
    first, second = policy.act(blank), policy.act(blank)
    found = f"{policy.name}, a decision every {policy.period_s:g} s"
    if not np.array_equal(first, second):
        return fail("policy", f"{found}; answers differ", "use another policy")
    return ok("policy", found)


def check_card(config: RuntimeConfig) -> Finding:
    """Compare the policy with the card beside it, and tell what the card says it can do."""
    from twinscrew.runtime.policy.load import InHullUnits
    from twinscrew.runtime.policy.onnx import OnnxPolicy

    policy = _policy_of(config)
    if isinstance(policy, InHullUnits):
        policy = policy.policy
    if not isinstance(policy, OnnxPolicy):
        return ok("policy card", f"{policy.name} needs none: it is no trained file")
    path = shipped("policies", config.policy, ".onnx").with_suffix(".json")
    if not path.is_file():
        return warn("policy card", f"no {path.name}", "take it along: `twinscrew export` writes it")
    try:
        card = json.loads(path.read_bytes())
        told = {key: card["metadata"][key] for key in SAME}
        rates = [float(setting["success_rate"]) for setting in card["scores"]["settings"]]
        if not rates or not all(0.0 <= rate <= 1.0 for rate in rates):
            raise ValueError(f"success rates {rates}")
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        return fail("policy card", f"{path.name} is no card: {error!r}", "export the policy again")
    return _judged(policy, told, rates)


def _judged(policy: OnnxPolicy, told: dict[str, Any], rates: list[float]) -> Finding:
    for key, value in told.items():
        given = getattr(policy.metadata, key)
        if given != value:
            found = f"of another file: {key} is {value}, the policy's {given}"
            return fail("policy card", found, "put the card and the file that belong together")
    least, most = min(rates), max(rates)
    found = f"{told['training_run']}, {100 * least:.1f} to {100 * most:.1f} % success in training"
    if least < WORTHY:
        return warn("policy card", found, "a policy that fails this often is not for the water")
    return ok("policy card", found)


CHECKS_OF_RECORDINGS: Final = "twinscrew.recording_checks"
"""The group of entry points whose functions know what a recording says of the vessel's file; they
are the simulator's, which a boat does not have."""


def check_recordings(config: RuntimeConfig, recordings: Sequence[Path]) -> list[Finding]:
    """Compare recorded trials with what the configured vessel would have done."""
    checks = entry_points(group=CHECKS_OF_RECORDINGS)
    if not any(_is_installed(check) for check in checks):
        advice = "do it at a desk: pip install 'twinscrew[sim]'"
        return [warn("recordings", "the simulator is not installed", advice)]
    return [_guarded(check.name, partial(_compared, check, config, recordings)) for check in checks]


def _is_installed(check: EntryPoint) -> bool:
    try:
        return find_spec(check.module) is not None
    except ModuleNotFoundError:
        return False


def _compared(check: EntryPoint, config: RuntimeConfig, recordings: Sequence[Path]) -> Finding:
    what = f"{check.name} {config.vessel}"
    good, words = check.load()(recordings, config.vessel)
    if good:
        return ok(what, words)
    return fail(what, words, "twinscrew identify RECORDING --vessel FILE --out NEW.toml")


def examine(config: RuntimeConfig, folder: Path, sources: Sources | None = None) -> list[Finding]:
    """Do every check that needs nothing but this machine; a refusal is a FAIL line.

    With `sources`, the files are compared with their manifest, too.
    """
    checks: list[tuple[str, Callable[[], Finding]]] = [
        ("Python", check_python),
        ("packages", check_packages),
        ("native kernels", check_native),
        ("processor", check_cores),
        ("memory", check_memory),
        ("clock", check_clock),
        ("priority", check_priority),
        ("disk", lambda: check_disk(folder)),
        ("permissions", lambda: check_permissions(config)),
        ("network", lambda: check_network(config)),
        ("sensor", lambda: check_sensor(config)),
        ("chart", lambda: check_chart(config)),
        ("policy", lambda: check_policy(config)),
        ("policy card", lambda: check_card(config)),
        ("autopilot port", lambda: check_autopilot_port(config)),
        ("Zenoh", lambda: check_bus(config)),
    ]
    if sources is not None:
        checks.append(("files", lambda: check_files(sources)))
    return [_guarded(what, check) for what, check in checks]


def _guarded(what: str, check: Callable[[], Finding]) -> Finding:
    try:
        return check()
    except (TwinscrewError, OSError) as error:
        return fail(what, str(error), "put right what the line says")
