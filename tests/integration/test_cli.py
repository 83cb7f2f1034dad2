"""The command line's manners: what it lists, refuses and loads."""

import os
import shlex
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from tests.harness.commands import TWINSCREW, twinscrew

from twinscrew.runtime.settings import CONFIG_DIR

pytestmark = pytest.mark.slow

AC_IQN = str(CONFIG_DIR / "training" / "ac_iqn.toml")
DATA = str(Path(__file__).parents[2] / "docs" / "data" / "ac_iqn")
COMMANDS = ("sitl", "run", "train", "export", "evaluate", "replay", "bench", "doctor")
HEAVY = ("torch", "matplotlib", "onnxruntime", "scipy", "zenoh", "twinscrew.hil_sim")


def loaded_by(*words: str) -> list[str]:
    """Give which heavy modules a command loads."""
    code = f"""
import sys
sys.argv = {["twinscrew", *words]!r}
from twinscrew.runtime.cli.main import main
try:
    main()
finally:
    print("LOADED", *(name for name in {HEAVY!r} if name in sys.modules))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=250)
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("LOADED")]
    return line.split()[1:]


def test_help_lists_every_command_with_what_it_does() -> None:
    done = twinscrew("--help")
    assert done.returncode == 0
    for command in COMMANDS:
        assert command in done.stdout
    assert "what is deployed on the boat" in done.stdout


def test_help_loads_nothing_heavy() -> None:
    assert loaded_by("--help") == []


def test_a_boats_commands_load_neither_torch_nor_the_simulator() -> None:
    loaded = loaded_by("doctor", "--json")
    assert "onnxruntime" in loaded  # it looked at the policy, so this test can see what is loaded
    assert not {"torch", "matplotlib", "twinscrew.hil_sim"} & set(loaded)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(command: str) -> None:
    done = twinscrew(command, "--help")
    assert done.returncode == 0
    assert command in done.stdout


@pytest.mark.parametrize(
    "words",
    [
        ("sail",),
        ("--fast",),
        ("run",),
        ("sitl", "--vessels", "three"),
        ("sitl", "--vessels", "0"),
        ("sitl", "--seed", "-1"),
        ("replay",),
    ],
)
def test_wrong_usage_is_status_2_and_one_line_that_says_where_help_is(
    words: tuple[str, ...],
) -> None:
    done = twinscrew(*words)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("twinscrew: error: ")
    assert line.endswith("--help')")


def test_without_a_word_it_shows_its_help_and_is_content() -> None:
    bare, asked, short = twinscrew(), twinscrew("--help"), twinscrew("-h")
    assert (bare.returncode, bare.stderr) == (0, "")
    assert bare.stdout == asked.stdout == short.stdout
    group, of_group = twinscrew("manifest"), twinscrew("manifest", "-h")
    assert (group.returncode, group.stderr) == (0, "")
    assert group.stdout == of_group.stdout


def test_it_says_its_version() -> None:
    assert twinscrew("--version").stdout == f"twinscrew {version('twinscrew')}\n"


def test_units_in_brackets_are_in_the_help() -> None:
    assert "[s]" in twinscrew("doctor", "-h").stdout


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("twinscrew repl", ["replay"]),
        ("twinscrew train", ["train", "train-report"]),
        ("twinscrew run --conf", ["--config"]),
        ("twinscrew manifest ver", ["verify"]),
    ],
)
def test_a_shell_completes_commands_and_options(line: str, found: list[str]) -> None:
    done = twinscrew(
        _TWINSCREW_COMPLETE="complete_bash",
        COMP_WORDS=line,
        COMP_CWORD=str(len(line.split()) - 1),
    )
    assert done.stdout.split() == found


def test_completing_a_commands_name_loads_nothing_heavy() -> None:
    completing = {"_TWINSCREW_COMPLETE": "complete_bash", "COMP_CWORD": "1"}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {**completing, "COMP_WORDS": "twinscrew ev"}.items():
            patch.setenv(name, value)
        assert loaded_by() == []


INTERRUPTED = """
import sys

class CtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == package:
            raise KeyboardInterrupt

package, sys.argv = sys.argv[1], ["twinscrew", "doctor", "--json"]
sys.meta_path.insert(0, CtrlC())
from twinscrew.runtime.cli.__main__ import main
main()
"""


@pytest.mark.parametrize("package", ["typer", "numpy", "zenoh", "onnxruntime"])
def test_ctrl_c_while_a_package_is_loaded_leaves_no_traceback(package: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, package], capture_output=True, text=True, timeout=250
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("run", "--config", "none.toml"), ["none.toml", "No such file"]),
        (("replay", "none"), ["none"]),
        (("sitl", "--scenario", "storm"), ["storm", "head_on"]),
        (("sitl", "--scenario", "head_on", "--vessels", "3"), ["head_on.toml", "vessels", "3"]),
        (("sitl", "--max-time", "0", "--lockstep"), ["--max-time", "greater than 0"]),
        (("sitl", "--max-time", "nan", "--lockstep"), ["--max-time", "greater than 0"]),
        (("bench", "--only", "everything"), ["--only", "everything", "latency"]),
        (("doctor", "--config", "none.toml"), ["none.toml"]),
        (("manifest", "keys", f"{__file__}/keys"), [f"{__file__}/keys", "Not a directory"]),
        (("run", "--config", "/dev/zero"), ["/dev/zero", "more than 16 MB"]),
        (("train", AC_IQN, "--seeds", "9" * 30), ["--seeds", "at most 4294967295"]),
        (("train-report", DATA, "--out", __file__), [__file__, "File exists"]),
    ],
)
def test_what_is_refused_is_one_line_on_standard_error_and_status_2(
    words: tuple[str, ...], told: list[str]
) -> None:
    done = twinscrew(*words)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("twinscrew: error: ")
    for word in told:
        assert word in line


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("words", [("--help",), ("doctor", "--json")])
def test_output_that_cannot_be_written_is_one_line_and_status_2(
    words: tuple[str, ...], unbuffered: str
) -> None:
    environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*TWINSCREW, *words], stdout=full, stderr=subprocess.PIPE, text=True, env=environment
        )
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "twinscrew: error: what was being written is incomplete: No space left on device"
    ]


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_has_gone_is_no_complaint(unbuffered: str) -> None:
    ours, theirs = os.pipe()
    os.close(ours)
    environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    done = subprocess.run(
        [*TWINSCREW, "doctor", "--json"], stdout=theirs, stderr=subprocess.PIPE, env=environment
    )
    os.close(theirs)
    assert (done.returncode, done.stderr) == (1, b"")


def test_a_terminal_without_our_letters_gets_others_in_their_place() -> None:
    done = twinscrew("doctor", PYTHONIOENCODING="ascii", COLUMNS="60")
    assert done.stderr == ""
    assert "Python" in done.stdout
    assert done.stdout.isascii()


def test_a_program_whose_output_is_closed_does_its_work() -> None:
    closed = f"exec {shlex.join([*TWINSCREW, '--help'])} >&-"
    assert subprocess.run(["bash", "-c", closed], stderr=subprocess.PIPE).stderr == b""


def test_names_with_brackets_are_printed_as_they_are(tmp_path: Path) -> None:
    sets, results = tmp_path / "sets.toml", tmp_path / "[/of] [old]"
    sets.write_text('[[set]]\nname = "[/one]"\nvessels = 1\nbuoys = 0\n')
    words = ("--methods", "apf", "--sets", sets, "--episodes", "1", "--jobs", "1")
    sailed = twinscrew("experiment", *words, "--out", results, COLUMNS="400")
    told = twinscrew("report", results, "--no-trajectories", "--failures", "0", COLUMNS="400")
    again = twinscrew("experiment", "--rerun", f"{results}:1", "--out", tmp_path / "[/again]")
    for done in (sailed, told):
        assert done.returncode == 0, done.stderr
        assert str(results) in done.stdout
    assert "[/one]" in sailed.stdout
    assert "[/again]" in again.stdout.replace("\n", "")
    assert again.returncode == 0, again.stderr
