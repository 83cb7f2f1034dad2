"""Holds our simulated autopilot and a real ArduRover against the same script; prints a table.

    python -m tests.conformance                          # ours
    ARDUROVER=/path/to/ardurover python -m tests.conformance

Exit status 0 if no step failed; 1 if one did; 2 if the real one cannot be started.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.table import Table
from tests.conformance.endpoints import Endpoint, Ours, Real
from tests.conformance.station import Station
from tests.conformance.steps import STEPS

from twinscrew.runtime.errors import TwinscrewError

BINARY = "ARDUROVER"
SAME, NOT_TRIED = "same", "not tried"


def run(endpoint: Endpoint, tell: Callable[[str], None]) -> dict[str, str]:
    """Give each step's outcome: "same", or what was different."""
    station = Station(endpoint)
    outcomes = {}
    for step in STEPS:
        try:
            step(station)
            outcomes[step.__name__] = SAME
        except AssertionError as error:
            outcomes[step.__name__] = (
                f"differs: {str(error).splitlines()[0] if str(error) else step.__name__}"
            )
        except TwinscrewError as error:
            outcomes[step.__name__] = f"broke: {error}"
        tell(f"{step.__name__}: {outcomes[step.__name__]}")
    return outcomes


def main() -> int:
    """Run the script against everything there is."""
    console, err = Console(), Console(stderr=True)
    binary = os.environ.get(BINARY, "")
    ours = Ours()
    columns = {"ours": run(ours, lambda words: err.print(f"ours  {words}"))}
    ours.close()
    if binary:
        with tempfile.TemporaryDirectory() as folder:
            try:
                real = Real(Path(binary), Path(folder))
            except TwinscrewError as error:
                err.print(f"the real one cannot be tried: {error}")
                return 2
            columns["ArduRover"] = run(real, lambda words: err.print(f"real  {words}"))
            real.close()
    else:
        columns["ArduRover"] = {}
        err.print(f"no ArduRover: set {BINARY} to the path of ArduPilot's build/sitl/bin/ardurover")
    table = Table("what ArduRover does", *columns)
    for step in STEPS:
        cells = [outcomes.get(step.__name__, NOT_TRIED) for outcomes in columns.values()]
        table.add_row((step.__doc__ or step.__name__).strip(), *cells)
    console.print(table)
    failed = any(words != SAME for column in columns.values() for words in column.values())
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
