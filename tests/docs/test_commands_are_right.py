"""Every command that the documentation shows or mentions is one that this version knows."""

import shlex
import subprocess
import tomllib

import pytest
from tests.docs.commands import OURS, PAGES, ROOT, Command, commands_of

from twinscrew.runtime.cli.main import find_command

COMMANDS = [command for page in PAGES for command in commands_of(page)]
OF_TWINSCREW = [command for command in COMMANDS if command.words.startswith("twinscrew ")]
PLACEHOLDERS = ("...", "COMMAND")


def words_of(command):
    """Give what follows `twinscrew`, without shell's ends and optional parts' brackets."""
    words = command.words.replace("[", "").replace("]", "")
    for end in (" > ", " | ", " && ", " &"):
        words = words.partition(end)[0]
    return [word for word in shlex.split(words)[1:] if word != "..."]


def refusal(command):
    """Give why the command line refuses a command; None if it does not."""
    name, *words = words_of(command)
    if name.startswith("-") or name in PLACEHOLDERS:
        return None
    found = find_command(name)
    if found is not None and words and hasattr(found, "commands"):  # as `manifest sign`
        name, *words = words
        found = found.commands.get(name)
    if found is None:
        return f"no command {name}"
    try:
        found.make_context(name, words)
    except Exception as error:  # click's, or those of the copy of it that typer has
        return None if is_excused(type(error).__name__, str(error), command) else str(error)
    return None


def is_excused(kind, words, command):
    """Tell whether a command is all right although it is refused here."""
    if kind == "Exit":  # --help
        return True
    if kind in {"MissingParameter", "BadOptionUsage"}:
        return not command.is_shown  # mentioned: "`twinscrew replay` says so"
    return kind == "BadParameter" and "does not exist" in words


@pytest.mark.slow
@pytest.mark.parametrize("command", OF_TWINSCREW, ids=str)
def test_the_command_line_knows_it(command):
    assert refusal(command) is None


@pytest.mark.parametrize(
    "words",
    [
        "twinscrew sail",
        "twinscrew sitl --fast",
        "twinscrew replay",
        "twinscrew manifest sing",
        "twinscrew manifest sign --loud",
    ],
)
def test_a_wrong_command_would_be_found(words):
    assert refusal(Command("page", 1, words, True, None)) is not None


TARGETS = [command for command in COMMANDS if command.words.startswith("make ")]


@pytest.mark.parametrize("command", TARGETS, ids=str)
def test_make_knows_it(command):
    target = shlex.split(command.words)[1]
    lines = (ROOT / "Makefile").read_text().splitlines()
    assert any(line.startswith(f"{target}:") for line in lines)


def test_every_command_to_be_copied_says_whether_it_is_run():
    silent = [str(command) for command in COMMANDS if command.is_shown and command.mark is None]
    assert silent == []


def test_a_command_that_is_not_run_says_why():
    marks = [(command, command.mark) for command in COMMANDS if command.mark is not None]
    silent = [str(command) for command, mark in marks if not mark.is_run and not mark.reason]
    assert silent == []
    assert sum(mark.is_run for _, mark in marks) > 20


def blocks(page, language):
    """Give a page's blocks of code in a language."""
    parts = page.read_text().split(f"```{language}\n")[1:]
    return [part.partition("```")[0] for part in parts]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_block_of_toml_can_be_read(page):
    for block in blocks(page, "toml"):
        lines = [line.removeprefix("   ") for line in block.splitlines()]
        tomllib.loads("\n".join(lines))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_in_a_block_is_marked_as_one(page):
    unnamed = [block for block in blocks(page, "") if OURS.match(block.strip())]
    assert unnamed == []


def test_every_target_of_the_makefile_has_a_line_of_help():
    said = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True)
    assert {"sitl", "test", "docs", "wheel"} <= {
        line.split()[0] for line in said.stdout.splitlines()
    }
