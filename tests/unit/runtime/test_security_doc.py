"""docs/security.md is true: every promise names tests, and they exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
DOC = (ROOT / "docs" / "security.md").read_text()
PROMISED = DOC.split("## What is promised\n")[1].split("\n## ")[0]
NAMED = re.findall(r"`(tests/\S+?\.py)::(test_\w+)`", DOC)


@pytest.mark.parametrize(("file", "name"), sorted(set(NAMED)))
def test_every_test_that_the_document_names_exists(file: str, name: str) -> None:
    assert f"def {name}(" in (ROOT / file).read_text()


def test_every_promise_names_a_test() -> None:
    rows = [line for line in PROMISED.splitlines() if line.startswith("| ")]
    promises = [row for row in rows if not row.startswith(("| promise |", "| --- |"))]
    assert len(promises) > 20
    assert [row for row in promises if "::test_" not in row] == []
