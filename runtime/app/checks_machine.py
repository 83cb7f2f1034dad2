"""What the doctor looks at of the computer: processor, memory, clock, priority, disk."""

from __future__ import annotations

import ctypes
import os
import shutil
import time
from pathlib import Path
from typing import Final

from twinscrew.runtime.app.finding import Finding, fail, ok, warn

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
