"""ONNX Runtime keeps to itself: a boat, and whoever trains one, tells nobody what they do."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
ONLY_HERE = ROOT / "runtime" / "policy" / "onnx_runtime.py"
ASK = """
from pathlib import Path
from twinscrew.runtime.policy.onnx import OnnxPolicy
from twinscrew.runtime.settings import shipped
OnnxPolicy(shipped("policies", "ac_iqn", ".onnx"))
"""


def test_a_policy_leaves_no_identifier_of_the_machine_in_the_users_home(tmp_path):
    home = {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    chosen = ("XDG_CACHE_HOME", "ORT_DISABLE_TELEMETRY")
    given = {key: value for key, value in os.environ.items() if key not in chosen}
    subprocess.run([sys.executable, "-c", ASK], env=given | home, check=True, timeout=250)
    assert list(tmp_path.rglob("*")) == []


def test_it_is_loaded_from_one_place_only():
    for folder in ("runtime", "training", "export", "hil_sim"):
        for path in (ROOT / folder).rglob("*.py"):
            loads = "import onnxruntime" in path.read_text()
            assert loads == (path == ONLY_HERE), path
