"""The command line: one command, `twinscrew`, whose subcommands are found when they are asked for.

Each subcommand is a function with typer annotations, registered as an entry point of the group
``twinscrew.commands``. So the boat's installation has only the boat's commands, no command imports
another's libraries, and `twinscrew run` starts without torch, matplotlib or the simulator.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import signal
import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points, version
from importlib.util import find_spec
from types import FrameType
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from twinscrew.runtime.errors import TwinscrewError

GROUP = "twinscrew.commands"
PROGRAM = "twinscrew"
USAGE_ERROR = 2
INTERRUPTED = 130
READER_GONE = 1
FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""What the system says when nothing more can be written; it does not say where."""
SUMMARIES = {
    "sitl": "Sail simulated vessels with the real runtime, sensors to thrust.",
    "faults": "Make faults on purpose, and hold the boat to what was promised.",
    "soak": "Sail for long with faults at random, and look for what grows or breaks.",
    "chart": "Make a boat's chart of GeoJSON, shapefiles and S-57 cells.",
    "view": "Show boats in a browser on this machine: under way, or from a recording.",
    "run": "Run one vessel's runtime: what is deployed on the boat.",
    "trial": "Sail scripted manoeuvres on the boat, to identify its vessel from.",
    "identify": "Identify a vessel's mass, drag and thrust from recorded trials.",
    "send": "Give a boat goals, and let it drive: what `ros2 topic pub` does, without ROS 2.",
    "train": "Train policies in the fast environment.",
    "train-report": "Draw the learning curves of training runs.",
    "export": "Turn a training run's actor into a self-contained ONNX file.",
    "evaluate": "Score a policy in the training environment.",
    "experiment": "Sail the paper's experiments: many episodes, several methods.",
    "report": "Turn an experiment's results into tables and figures.",
    "judge": "Judge how vessels kept the rules of the road, by two judges, and draw it.",
    "falsify": "Search for motions of another vessel that the assurance does not keep clear of.",
    "replay": "Feed a recording to the core again and print the decisions' SHA-256.",
    "perceive": "Segment one point cloud file and print its objects.",
    "track": "Track recorded detections of several sensors, and score the tracks.",
    "bench": "Measure speed, latency and perception, and print the figures.",
    "manifest": "Write, sign and check the list of files that a boat's runtime may read.",
    "consent": "Let the next start of a boat's runtime arm it, once.",
    "signing": "Make the key that signs MAVLink frames, and put it into an autopilot.",
    "doctor": "Check this machine and this installation, line by line.",
}
"""What `twinscrew --help` says of each command, in its order, without importing any."""
_UsageError: Any = typer.BadParameter.mro()[1]
"""What click, or the copy of it in newer typers, raises for wrong usage."""
_COMPLETING, _LINE = "_TWINSCREW_COMPLETE", "_TYPER_COMPLETE_ARGS"
"""What a shell that wants words completed sets: that it does, and in bash the words so far."""


class LazyGroup(TyperGroup):
    """A group that imports a subcommand's module only when that subcommand is used."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        """Name the installed commands, the known ones first and in their order."""
        found = _installed()
        known = [name for name in SUMMARIES if name in found]
        return known + sorted(set(found) - set(known))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """Import a command, or describe it if only the help is wanted."""
        if _help_of_all_is_wanted() and cmd_name in _installed():
            return _as_command(_described(cmd_name), cmd_name)
        return find_command(cmd_name)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write every command with what it does, not cut short."""
        known = [(name, SUMMARIES.get(name, "")) for name in self.list_commands(ctx)]
        with formatter.section("Commands"):
            formatter.write_dl(known)


def find_command(name: str) -> Any:
    """Import a command and give it as click has it; None if it is not installed."""
    entry = _installed().get(name)
    return None if entry is None else _as_command(_load(entry), name)


def main() -> NoReturn:
    """Run the command line: exit status 2, and one line on standard error, for what is refused."""
    app = typer.Typer(
        cls=LazyGroup,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # which would swallow units: [s], [m]
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback(help="Autonomy runtime for twin-propeller surface vessels.")(_options)
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_DFL:  # under nohup it is ignored
            signal.signal(number, _end)
    bear_any_text()
    try:
        try:
            status = app(sys.argv[1:] or ["--help"], prog_name=PROGRAM, standalone_mode=False)
        finally:
            flush()
    except _UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # a group, and none of its commands
            print(error.format_message())
            sys.exit(0)
        where = error.ctx.command_path if error.ctx is not None else PROGRAM
        words = " ".join(error.format_message().split())
        print(f"twinscrew: error: {words.rstrip('.')} (see '{where} --help')", file=sys.stderr)
        sys.exit(USAGE_ERROR)
    except typer.Abort:
        sys.exit(INTERRUPTED)
    except TwinscrewError as error:
        print(f"twinscrew: error: {error}", file=sys.stderr)
        sys.exit(USAGE_ERROR)
    except OSError as error:
        if error.errno == errno.EPIPE:  # as `| head` does when it has seen enough
            sys.exit(READER_GONE)
        if error.filename is None and error.errno not in FULL:  # of no file that anybody named
            raise
        where = error.filename or "what was being written is incomplete"
        print(f"twinscrew: error: {where}: {error.strerror}", file=sys.stderr)
        sys.exit(USAGE_ERROR)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    sys.exit(status if isinstance(status, int) else 0)


def _print_version(asked: bool) -> None:
    if asked:
        print(f"{PROGRAM} {version(PROGRAM)}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None: ...


def _end(number: int, _frame: FrameType | None) -> NoReturn:
    """End as an exception does: what was opened is closed, and what was started is stopped."""
    sys.exit(128 + number)


def _installed() -> dict[str, EntryPoint]:
    """Find the commands; a boat's wheel names the simulator's too, but has no such folder."""
    return {entry.name: entry for entry in entry_points(group=GROUP) if _is_here(entry)}


def _is_here(entry: EntryPoint) -> bool:
    package, _, rest = entry.module.partition(".")
    folder = rest.partition(".")[0]
    return package != "twinscrew" or find_spec(f"{package}.{folder}") is not None


def _help_of_all_is_wanted() -> bool:
    """Tell whether all commands are to be described, and none is to be run."""
    if _COMPLETING in os.environ:  # the name of a command is wanted, or a word after it
        line = os.environ.get(_LINE) or os.environ.get("COMP_WORDS", "")
        return len(line.split()) + line.endswith((" ", "\n")) <= 2
    return len(sys.argv) < 2 or sys.argv[1] in {"--help", "-h"}


def _described(name: str) -> Callable[[], None]:
    def command() -> None: ...

    command.__doc__ = SUMMARIES.get(name, "")
    return command


def _load(entry: EntryPoint) -> Callable[..., None] | typer.Typer:
    try:
        function: Callable[..., None] | typer.Typer = entry.load()
    except ModuleNotFoundError as error:
        extra = "train" if entry.name in {"train", "train-report", "export", "evaluate"} else "sim"
        raise TwinscrewError(
            f"'{entry.name}' needs the package {error.name!r}: pip install 'twinscrew[{extra}]'"
        ) from error
    return function


def _as_command(function: Callable[..., None] | typer.Typer, name: str) -> Any:
    if isinstance(function, typer.Typer):  # it has subcommands of its own
        return typer.main.get_command(function)
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    app.command(name=name)(function)
    return typer.main.get_command(app)


# -- What a program prints: it may have nowhere to go, and no way to be written.


def bear_any_text() -> None:
    """Print `?` for what the terminal's encoding has no letter for."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def flush() -> None:
    """Write what is still to be printed: at the interpreter's end a failure would have no answer.

    Raises
    ------
    OSError
        The reader has gone, or the disk is full. Nothing is printed to there any more.
    """
    if sys.stdout is None:  # closed by who started us
        return
    try:
        sys.stdout.flush()
    except OSError:
        give_up()
        raise


def give_up() -> None:
    """Let standard output go nowhere."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
