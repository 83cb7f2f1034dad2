"""Finds the commands that README and docs/ show, and what is said about running them.

A comment, which no reader sees, stands before a block or a table, or at the end of a table's row:

    <!-- run -->                                it must end with status 0
    <!-- run; with: --max-time 3; exit: 1 -->   these words are added; it ends with that status
    <!-- run; until: http:// -->                it is stopped (Ctrl-C) when it has said so
    <!-- run; says: decisions -->               and it must have said so
    <!-- not run: needs a boat -->              only its words are checked
"""

from __future__ import annotations

import re
import shlex
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = (
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "decisions").glob("*.md")),
)
SHELL = ("sh", "bash")
OURS = re.compile(r"(twinscrew|make|pytest|python -m|python tests/\S+) +\S")
"""What is a command of ours, if it stands as code within a sentence or a table."""
MARK = re.compile(r"<!-- *(run|not run)\b(.*?)-->")
CODE = re.compile(r"`([^`]+)`")


@dataclass(frozen=True)
class Mark:
    """What a page says about running a command."""

    is_run: bool
    reason: str = ""
    added: str = ""
    until: str = ""
    says: str = ""
    status: int = 0


@dataclass(frozen=True)
class Command:
    """A command as a page shows it."""

    page: str
    line: int
    words: str
    is_shown: bool
    """Whether it stands in a block or a table, to be copied; else it is mentioned."""
    mark: Mark | None

    def __str__(self) -> str:
        first, *_ = self.words.splitlines()
        return f"{self.page}:{self.line}: {first}"


def commands_of(page: Path) -> list[Command]:
    """Give a page's commands, in order."""
    return list(_commands(page.relative_to(ROOT).as_posix(), page.read_text().splitlines()))


def _commands(page: str, lines: list[str]) -> Iterator[Command]:
    language: str | None = None  # of the block we are in
    block: list[str] = []
    mark: Mark | None = None  # of the block or table that comes next, or that we are in
    in_table = False
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if text.startswith("```") and language is None:
            language, block = text[3:], []
        elif text.startswith("```"):
            for words in in_block(str(language), block):
                yield Command(page, number, words, True, mark)
            language, mark = None, None
        elif language is not None:
            block.append(line)
        else:
            here = _mark(text)
            is_row = text.startswith("|")
            if here is not None and not is_row:
                mark = here
            elif in_table and not is_row:
                mark = None
            in_table = is_row
            for code in CODE.findall(text):
                if OURS.match(code):
                    yield Command(page, number, code, is_row, here or mark if is_row else None)


def in_block(language: str, lines: list[str]) -> list[str]:
    """Give a block's commands: of a shell its lines, of Python the whole."""
    if language == "python":
        return [f"python -c {shlex.quote(textwrap.dedent(chr(10).join(lines)))}"]
    if language not in SHELL:
        return []
    joined = re.sub(r"\\\n *", "", "\n".join(lines)).split("\n")
    bare = [re.sub(r"\s+# .*", "", line).strip() for line in joined]
    return [line for line in bare if line and not line.startswith("#")]


def _mark(text: str) -> Mark | None:
    match = MARK.search(text)
    if match is None:
        return None
    if match[1] == "not run":
        return Mark(is_run=False, reason=match[2].strip(" :"))
    told = dict(re.findall(r"; *(\w+): *([^;]+?) *(?=;|$)", match[2].strip()))
    known = {"with", "until", "says", "exit"}
    if unknown := set(told) - known:
        raise ValueError(f"unknown in a mark: {unknown}; known: {known}")
    return Mark(
        is_run=True,
        added=told.get("with", ""),
        until=told.get("until", ""),
        says=told.get("says", ""),
        status=int(told.get("exit", "0")),
    )
