"""The boat's wheel: built as deploy/wheel.sh builds it, and looked into."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
GREATEST_MB = 2.4


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    words = ["-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run(
        [sys.executable, *words, "--wheel-dir", str(folder), str(ROOT)],
        env={**os.environ, "TWINSCREW_BOAT": "1"},
        check=True,
        timeout=280,
    )
    (built,) = folder.glob("*.whl")
    return built


def test_it_carries_the_runtime_and_its_configuration_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    inside = {name.split("/")[1] for name in names if name.startswith("twinscrew/")}
    assert inside == {"runtime", "config"}
    assert any(name.startswith("twinscrew/runtime/_native.") for name in names)
    policies = (
        "policies/ac_iqn.onnx",
        "policies/ac_iqn.json",
        "policies/apf.toml",
        "policies/mpc.toml",
    )
    for needed in ("runtime.toml", *policies, "vessels/wam_v.toml", "vessels/otter.toml"):
        assert f"twinscrew/config/{needed}" in names
    for left_out in ("config/training", "config/scenarios", "runtime/native"):
        assert not [name for name in names if name.startswith(f"twinscrew/{left_out}/")]
    assert wheel.stat().st_size < 1e6 * GREATEST_MB


def test_it_carries_every_module_of_the_runtime(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    modules = (ROOT / "runtime").rglob("*.py")
    missing = [m for m in modules if f"twinscrew/{m.relative_to(ROOT).as_posix()}" not in names]
    assert missing == []
