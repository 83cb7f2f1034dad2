"""What was promised and measured, for people."""

from __future__ import annotations

from collections.abc import Iterable

from rich.table import Table

from twinscrew.hil_sim.faults.verdict import Verdict


def as_table(verdicts: Iterable[Verdict], *, names: Iterable[str] = ()) -> Table:
    """Give a table, one line a promise.

    Parameters
    ----------
    names
        What to call them instead of their files, as the vessels' names.
    """
    table = Table("", "fault", "what", "promised", "measured", "")
    for verdict, name in zip(verdicts, [*names] or [v.name for v in verdicts], strict=True):
        for number, row in enumerate(verdict.rows):
            first = number == 0
            mark = "[green]kept[/green]" if row.kept else "[red]BROKEN[/red]"
            head = (name, verdict.fault) if first else ("", "")
            table.add_row(*head, row.what, row.promised, row.measured, mark)
        table.add_section()
    return table
