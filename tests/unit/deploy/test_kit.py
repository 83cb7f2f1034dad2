"""The deployment kit's files, as far as they can be tried without a boat."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from twinscrew.runtime.vessel.config import RuntimeConfig, load_config
from twinscrew.runtime.vessel.pipeline import make_pipeline

ROOT = Path(__file__).parents[3]
BOAT = ROOT / "deploy" / "boat.toml"
UNIT = ROOT / "deploy" / "twinscrew@.service"


def test_the_example_configuration_loads_and_its_boat_can_be_made():
    config = load_config(BOAT)
    make_pipeline(config)
    assert config.name == "wamv"


def test_the_example_never_arms_or_takes_the_boat_by_itself():
    autopilot = load_config(BOAT).autopilot
    assert autopilot.arm is False
    assert autopilot.ask_manual.value == "never"
    assert autopilot.write_parameters is False


def keys_with_comments(text):
    """Give every key, and whether a comment stands above it or above its table."""
    told, found = False, {}
    for line in text.splitlines():
        if line.startswith("#"):
            told = True
        elif not line.strip():
            told = False
        elif match := re.match(r"(\w+) = ", line):
            found[match[1]] = told
    return found


def test_every_key_of_the_example_stands_below_a_comment():
    silent = [key for key, told in keys_with_comments(BOAT.read_text()).items() if not told]
    assert silent == []


def test_the_unit_and_the_example_mean_the_same_places():
    unit, config = UNIT.read_text(), load_config(BOAT)
    assert f"/var/lib/twinscrew/{config.name}" == config.recording.folder
    assert "WorkingDirectory=/var/lib/twinscrew/%i" in unit
    assert "--config /etc/twinscrew/%i.toml" in unit


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")
def test_systemd_accepts_the_unit(tmp_path):
    here = tmp_path / UNIT.name
    program = shutil.which("true")
    here.write_text(UNIT.read_text().replace("/opt/twinscrew/bin/twinscrew", program))
    verdict = subprocess.run(
        ["systemd-analyze", "verify", str(here)], capture_output=True, text=True, timeout=60
    )
    assert verdict.returncode == 0, verdict.stderr
    assert "unit" not in verdict.stderr.lower(), verdict.stderr
    assert "Unknown" not in verdict.stderr, verdict.stderr


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")
def test_systemd_finds_the_unit_well_confined(tmp_path):
    here = tmp_path / UNIT.name
    here.write_text(UNIT.read_text())
    verdict = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--no-pager", str(here)],
        capture_output=True,
        text=True,
        timeout=60,
    )
    exposure = float(re.search(r"Overall exposure level.*?: ([\d.]+)", verdict.stdout)[1])
    assert exposure < 2.5, verdict.stdout


def test_the_unit_allows_the_priority_that_the_runtime_asks_for():
    unit = UNIT.read_text()
    allowed = int(re.search(r"^LimitRTPRIO=(\d+)$", unit, re.MULTILINE)[1])
    assert allowed >= load_config(BOAT).priority.fifo
    assert "RestrictRealtime=yes" not in unit


def test_the_watchdog_waits_longer_than_the_loops_slowest_sign_of_life():
    seconds = float(re.search(r"^WatchdogSec=([\d.]+)$", UNIT.read_text(), re.MULTILINE)[1])
    from twinscrew.runtime.vessel.process import SHARE

    tick_s = 1.0 / RuntimeConfig().command_rate_hz
    assert SHARE * seconds + tick_s < 0.5 * seconds


def test_the_boats_wheel_leaves_out_what_a_boat_does_not_need():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    boat = next(
        override
        for override in project["tool"]["scikit-build"]["overrides"]
        if override["if"].get("env", {}).get("TWINSCREW_BOAT")
    )
    assert set(boat["wheel"]["packages"].values()) == {"runtime", "config"}
    assert boat["cmake"]["define"]["TWINSCREW_SIMULATOR"] == "OFF"
    assert project["tool"]["cibuildwheel"]["environment"]["TWINSCREW_BOAT"] == "1"
    assert set(project["tool"]["cibuildwheel"]["archs"]) == {"x86_64", "aarch64"}


def test_a_wheel_is_built_for_every_python_that_is_allowed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    oldest = project["project"]["requires-python"].removeprefix(">=3.")
    built = [
        int(name.removeprefix("cp3").rstrip("-*"))
        for name in project["tool"]["cibuildwheel"]["build"]
    ]
    assert min(built) == int(oldest)
    assert built == list(range(min(built), max(built) + 1))


def steps(page, heading):
    """Give the lines of the first block of commands below a heading."""
    below = page.partition(f"\n## {heading}")[2]
    return below.partition("```sh\n")[2].partition("```")[0].splitlines()


def test_the_guide_lays_out_what_the_unit_needs():
    guide = (ROOT / "docs" / "deployment.md").read_text()
    lines = "\n".join(steps(guide, "3. "))
    unit, config = UNIT.read_text(), load_config(BOAT)
    assert re.search(r"^User=(\w+)$", unit, re.MULTILINE)[1] == "twinscrew"
    assert "adduser --system --group --home /var/lib/twinscrew twinscrew" in lines
    assert "python3 -m venv /opt/twinscrew" in lines
    assert "ExecStart=/opt/twinscrew/bin/twinscrew run" in unit
    assert f"/etc/twinscrew/{config.name}.toml" in lines
    for source in re.findall(r"deploy/\S+", lines):
        assert (ROOT / source).is_file(), source
    assert f"deploy/{UNIT.name} /etc/systemd/system/" in lines
