"""The command line's reference page: what `--help` says of every command, as one page."""

from __future__ import annotations

from typing import Any

from twinscrew.runtime.cli.main import SUMMARIES, find_command


def commands_page() -> str:
    """Give the page."""
    head = ["# Commands", "", "What `twinscrew COMMAND --help` says.", ""]
    return "\n".join([*head, *(section(name) for name in SUMMARIES)])


def section(name: str) -> str:
    """Give a command's part of the page, and those of its subcommands."""
    command = find_command(name)
    below = getattr(command, "commands", {})
    return "\n".join([_part(name, command), *(_part(f"{name} {n}", c) for n, c in below.items())])


def _part(name: str, command: Any) -> str:
    context = command.make_context(f"twinscrew {name}", [], resilient_parsing=True)
    rows = [row for param in command.get_params(context) if (row := option(param, context))]
    table = ["| | |", "| --- | --- |", *rows] if rows else []
    parts = [
        f"## {name}",
        "",
        command.help or "",
        "",
        f"`{command.get_usage(context)}`",
        "",
        *table,
        "",
    ]
    return "\n".join(parts)


def option(param: Any, context: Any) -> str:
    """Give an option's row: its names, what it does, its default."""
    record = param.get_help_record(context)
    if record is None or "--help" in param.opts:
        return ""
    names, words = (cell.replace("|", "\\|").replace("\n", " ") for cell in record)
    return f"| `{names}` | {words} |"
