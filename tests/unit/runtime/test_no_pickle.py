"""No file is ever unpickled: whoever can write a pickle can run any program."""

import ast
import io
import pickle
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from twinscrew.hil_sim.perceive.files import read_npy
from twinscrew.runtime.errors import ConfigError, MessageError

ROOT = Path(__file__).parents[3]
SOURCES = [
    file
    for folder in ("runtime", "training", "export", "hil_sim", "deploy", "docs")
    for file in sorted((ROOT / folder).rglob("*.py"))
]
UNSAFE = {"pickle", "cPickle", "_pickle", "dill", "cloudpickle", "shelve", "marshal", "jsonpickle"}
MUST_SAY = {
    ("torch", "load"): ("weights_only", True),
    ("np", "load"): ("allow_pickle", False),
    ("numpy", "load"): ("allow_pickle", False),
}
NEVER = {("joblib", "load"), ("pd", "read_pickle"), ("yaml", "load"), ("yaml", "unsafe_load")}
ONLY_TO_CATCH = "UnpicklingError"
"""What torch raises where it refuses a pickle: a name that may be used."""


def faults(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in UNSAFE:
            yield f"line {node.lineno}: from {node.module}"
        elif isinstance(node, ast.Import):
            for name in {alias.name.split(".")[0] for alias in node.names} & UNSAFE - {"pickle"}:
                yield f"line {node.lineno}: import {name}"
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            whole = node.value.id, node.attr
            if node.value.id in UNSAFE and node.attr != ONLY_TO_CATCH:
                yield f"line {node.lineno}: {'.'.join(whole)}"
            if whole in NEVER:
                yield f"line {node.lineno}: {'.'.join(whole)}"
        elif isinstance(node, ast.Call):
            yield from _call(node)


def _call(node: ast.Call) -> Iterator[str]:
    function = node.func
    if isinstance(function, ast.Name) and function.id in {"eval", "exec", "__import__"}:
        yield f"line {node.lineno}: {function.id}()"
    if not (isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name)):
        return
    rule = MUST_SAY.get((function.value.id, function.attr))
    if rule is None:
        return
    said = {word.arg: getattr(word.value, "value", None) for word in node.keywords}
    if said.get(rule[0]) is not rule[1]:
        yield f"line {node.lineno}: {function.value.id}.{function.attr} without {rule[0]}={rule[1]}"


def test_no_source_reads_a_pickle() -> None:
    found = {
        str(file.relative_to(ROOT)): list(faults(ast.parse(file.read_text()))) for file in SOURCES
    }
    assert {file: words for file, words in found.items() if words} == {}


@pytest.mark.parametrize(
    "text",
    [
        "from pickle import loads",
        "import dill",
        "import pickle\npickle.load(f)",
        "import pickle\nread = pickle.Unpickler",
        "import torch\ntorch.load(f)",
        "import torch\ntorch.load(f, weights_only=False)",
        "import numpy as np\nnp.load(f)",
        "import numpy as np\nnp.load(f, allow_pickle=True)",
        "import joblib\njoblib.load(f)",
        "eval(text)",
    ],
)
def test_the_search_finds_what_it_looks_for(text: str) -> None:
    assert list(faults(ast.parse(text)))


WATCHED = """
import sys

def refuse(event, args):
    if event == "pickle.find_class":
        raise RuntimeError(f"unpickled {args}")

import numpy, onnxruntime, scipy, zenoh
sys.addaudithook(refuse)
from tests.replay.references import decide
from twinscrew.runtime.doctor import listening as traffic
from twinscrew.runtime.vessel import approval
from twinscrew.runtime.vessel import lockstep, realtime
assert len(decide("ac_iqn")) > 20
import pickle, pathlib
try:
    pickle.loads(pickle.dumps(pathlib.Path("x")))
except RuntimeError as error:
    print(error)
"""


@pytest.mark.slow
def test_a_runtime_that_reads_a_recording_a_policy_and_its_settings_unpickles_nothing() -> None:
    """Asked of the interpreter itself, which also sees what packages do."""
    done = subprocess.run(
        [sys.executable, "-c", WATCHED], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("unpickled ")  # the hook was there


class Bomb:
    """What an attacker would leave: unpickled, it makes a file."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[object, ...]:
        return Path.touch, (self.mark,)


@pytest.fixture
def mark(tmp_path: Path) -> Path:
    return tmp_path / "it went off"


def test_a_bomb_would_go_off_if_it_were_unpickled(mark: Path) -> None:
    pickle.loads(pickle.dumps(Bomb(mark)))  # noqa: S301
    assert mark.exists()


def test_a_bomb_in_a_point_cloud_does_not_go_off(mark: Path) -> None:
    file = io.BytesIO()
    np.save(file, np.array([Bomb(mark)], dtype=object), allow_pickle=True)
    with pytest.raises(MessageError, match="npy"):
        read_npy(file.getvalue())
    assert not mark.exists()


def test_a_bomb_in_a_checkpoint_does_not_go_off(mark: Path, tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    from twinscrew.training.runs import load_checkpoint

    torch.save({"format": 1, "algorithm": "ac_iqn", "bomb": Bomb(mark)}, tmp_path / "last.pt")
    with pytest.raises(ConfigError, match=r"last\.pt: not a readable checkpoint"):
        load_checkpoint(tmp_path / "last.pt", "ac_iqn")
    assert not mark.exists()
