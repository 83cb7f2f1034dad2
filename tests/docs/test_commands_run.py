"""Every command that the documentation marks as run does run, and does what is said of it."""

import pytest
from tests.docs.commands import PAGES, commands_of
from tests.docs.sandbox import make_sandbox, run

MARKED = [
    command
    for page in PAGES
    for command in commands_of(page)
    if command.mark is not None and command.mark.is_run
]
pytestmark = pytest.mark.slow  # together; one takes some seconds


@pytest.fixture(scope="module")
def sandbox(tmp_path_factory):
    return make_sandbox(tmp_path_factory.mktemp("sandbox"))


@pytest.mark.parametrize("command", MARKED, ids=str)
def test_it_runs(command, sandbox):
    said = run(command, sandbox)
    assert command.mark.says in said
