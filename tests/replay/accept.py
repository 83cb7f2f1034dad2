"""Compares the core's decisions with the stored references, and renews these if you accept.

    python -m tests.replay.accept            show the differences, then ask whether to renew
    python -m tests.replay.accept --yes      show them and renew
    python -m tests.replay.accept --check    show them only; exit status 1 if there are any
    python -m tests.replay.accept --record   sail for a new recording first

On the machine that made a reference every bit counts; on another one, what its rounding explains
does not.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from tests.replay.differences import Difference, differences, summary
from tests.replay.references import (
    CASES,
    FOLDER,
    decide,
    machine,
    record,
    record_ship,
    sha256,
    store,
    stored,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command."""
    options = _options(arguments)
    if options.record:
        record()
        record_ship()
    found = {case: decide(case) for case in CASES}
    changed = [case for case, decisions in found.items() if not _tell(case, decisions)]
    if not changed or options.check:
        return 1 if changed else 0
    if not (options.yes or _agreed(changed)):
        return 1
    for case in changed:
        store(case, found[case])
    print(f"renewed in {FOLDER}: {', '.join(changed)}")
    return 0


def compare(case: str, decisions: tuple[bytes, ...]) -> list[Difference]:
    """Give the differences from a stored reference that count on this machine.

    Raises
    ------
    LookupError
        There is no such reference.
    """
    reference = stored(case)
    if reference is None:
        raise LookupError(f"{case}: no reference; python -m tests.replay.accept makes it")
    exact = reference.machine == machine()
    return list(differences(reference.decisions, decisions, exact=exact))


def _tell(case: str, decisions: tuple[bytes, ...]) -> bool:
    """Say how a case compares; True if nothing that counts differs."""
    try:
        found = compare(case, decisions)
    except LookupError as error:
        print(error)
        return False
    reference = stored(case)
    assert reference is not None
    how = "every bit" if reference.machine == machine() else "as another machine can"
    verdict = "as accepted" if not found else f"{len(found)} differences"
    print(f"{case}: {len(decisions)} decisions, {sha256(decisions)[:16]}...: {verdict} ({how})")
    for line in summary(found):
        print(f"  {line}")
    return not found


def _agreed(changed: Sequence[str]) -> bool:
    if not sys.stdin.isatty():
        print("not renewed: --yes says that these differences are meant")
        return False
    return input(f"Are these meant? Renew {', '.join(changed)}? [y/N] ").lower() == "y"


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.replay.accept", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--check", action="store_true", help="compare only")
    parser.add_argument("--yes", action="store_true", help="renew without asking")
    parser.add_argument("--record", action="store_true", help="sail for a new recording first")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
