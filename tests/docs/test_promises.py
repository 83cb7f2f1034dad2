"""Every promise names tests that exist: tests/PROMISES.md, docs/safety.md, docs/security.md."""

import ast
import itertools
import re

import pytest
from tests.docs.commands import ROOT

PAGES = [ROOT / name for name in ("tests/PROMISES.md", "docs/safety.md", "docs/security.md")]
NAMED = re.compile(r"`(tests/\S+?\.py)::(\w+)`")
OWN_FILE = {"docs/safety.md": "tests/unit/runtime/vessel/test_vessel.py"}
"""The file of the tests that a page names without one."""


def functions(file):
    """Give the names of a file's tests."""
    tree = ast.parse((ROOT / file).read_text())
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def named(page):
    """Give file and name of every test that a page names."""
    text = page.read_text()
    own = OWN_FILE.get(page.relative_to(ROOT).as_posix())
    bare = [(own, name) for name in re.findall(r"`(test_\w+)`", text)] if own else []
    return {*NAMED.findall(text), *bare}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_test_that_a_page_names_exists(page):
    missing = [
        f"{file}::{name}"
        for file, name in sorted(named(page))
        if not (ROOT / file).is_file() or name not in functions(file)
    ]
    assert missing == []


@pytest.mark.parametrize(
    ("page", "section"),
    [(PAGES[0], text.partition("\n")[0]) for text in PAGES[0].read_text().split("\n## ")[1:-1]]
    + [(PAGES[1], "Bad inputs"), (PAGES[2], "What is promised")],
    ids=lambda value: value if isinstance(value, str) else value.name,
)
def test_every_promise_names_its_test(page, section):
    text = page.read_text().split(f"## {section}\n")[1].split("\n## ")[0]
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    heads = {above for above, below in itertools.pairwise(rows) if below.startswith("| --- |")}
    promises = [row for row in rows if row not in heads and not row.startswith("| --- |")]
    assert len(promises) > 4
    assert [row for row in promises if "::test_" not in row] == []
