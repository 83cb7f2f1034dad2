"""Tries an installation as a boat has it: the runtime alone. Run it outside of the sources."""

from __future__ import annotations

import importlib.util
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

FOREIGN = ("torch", "aiohttp", "twinscrew.training", "twinscrew.export", "twinscrew.hil_sim")
"""What a boat does not carry."""
COMMANDS = ("run", "send", "replay", "doctor", "manifest")
"""The commands of a boat."""
PACKAGED = ("Python", "packages", "native kernels", "sensor", "policy")
"""The doctor's lines that are about the installation; the others are about the machine."""
BOATS = (("apf", "wam_v"), ("mpc", "wam_v"), ("mpc", "otter"))
"""Policies that are no files, and hulls that they must be able to drive."""
RING = 60
"""[-] Points around the buoy of the trial scan, on each of its beams."""


def main() -> None:
    """Check what is there, what is not, and that the commands of a boat answer."""
    carried = [name for name in FOREIGN if importlib.util.find_spec(name) is not None]
    if carried:
        sys.exit(f"the boat's installation carries {', '.join(carried)}")
    words = twinscrew("--help").stdout.split()
    missing = [name for name in COMMANDS if name not in words]
    if missing or "perceive" in words:
        sys.exit(f"commands: {missing or 'perceive'} should {'' if missing else 'not '}be there")
    print(f"commands     {', '.join(COMMANDS)}")
    found = objects(buoy(8.0, 0.4))
    if found != 1:
        sys.exit(f"one buoy was shown, but {found} objects were found")
    print("perception   one buoy shown, one found")
    with tempfile.TemporaryDirectory() as folder:
        for policy, vessel in BOATS:
            boat = Path(folder) / "boat.toml"
            boat.write_text(f'policy = "{policy}"\nvessel = "{vessel}"\n')
            examine("--config", str(boat))
            print(f"policy       {policy} drives {vessel}")
    examine()


def examine(*arguments: str) -> None:
    """Have the doctor look at this installation: what is packaged must be right."""
    findings = doctor(*arguments)
    failed = [finding for finding in findings if finding["verdict"] == "FAIL"]
    print(f"doctor       {len(findings)} lines, {len(failed)} FAIL")
    ours = [finding for finding in failed if finding["what"] in PACKAGED]
    if ours:
        sys.exit(json.dumps(ours, indent=1))


def objects(places: list[tuple[float, float, float]]) -> int:
    """Count what perception finds in a scan of these places; x forward, y left, z up."""
    import numpy as np

    from twinscrew.runtime.messages.types import PointCloud
    from twinscrew.runtime.perception.segmentation import Perception
    from twinscrew.runtime.perception.sensor import load_sensor

    points_S = np.array(places, np.float32) * np.array([1, -1, -1], np.float32)
    cloud = PointCloud(stamp_ns=0, frame_id="trial", points_S=points_S)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    return len(Perception(load_sensor("vrx32")).step(cloud, level).radius)


def buoy(ahead_m: float, radius_m: float) -> list[tuple[float, float, float]]:
    """Give the near side of a cylinder, as beams of a LiDAR see it: x forward, y left, z up."""
    widest = math.asin(radius_m / ahead_m)
    places = []
    for beam in range(6):
        for step in range(RING):
            bearing = 0.98 * widest * (2 * step / (RING - 1) - 1)
            half_chord = math.sqrt(radius_m**2 - (ahead_m * math.sin(bearing)) ** 2)
            distance = ahead_m * math.cos(bearing) - half_chord
            z = distance * math.tan(math.radians(-1.0 + 0.7 * beam))
            places.append((distance * math.cos(bearing), distance * math.sin(bearing), z))
    return places


def doctor(*arguments: str) -> list[dict[str, str]]:
    """Give the doctor's findings: it may find fault with this machine, but it has to answer."""
    answer = twinscrew("doctor", *arguments, "--json")
    findings: list[dict[str, str]] = json.loads(answer.stdout)["checks"]
    return findings


def twinscrew(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command that was installed beside this Python."""
    command = Path(sys.executable).with_name("twinscrew")
    answer = subprocess.run([command, *arguments], capture_output=True, text=True, check=False)
    if answer.returncode not in {0, 1}:
        sys.exit(f"twinscrew {' '.join(arguments)}: {answer.stderr}")
    return answer


if __name__ == "__main__":
    main()
