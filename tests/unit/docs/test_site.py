"""The documentation site's pages, as they are laid out before they are built."""

import importlib.util
import re
import shutil
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SITE = ROOT / "docs" / "site"


@pytest.fixture(scope="module")
def stage():
    sys.path.insert(0, str(SITE))
    spec = importlib.util.spec_from_file_location("stage", SITE / "stage.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.path.remove(str(SITE))


@pytest.fixture(scope="module")
def pages(stage, tmp_path_factory):
    folder = tmp_path_factory.mktemp("site") / "pages"
    assert stage.stage(folder) == []
    return folder


@pytest.mark.slow
def test_every_page_of_ours_can_be_reached(pages):
    named = set(re.findall(r"(\S+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE))
    laid_out = {path.relative_to(pages).as_posix() for path in pages.rglob("*.md")}
    led_to = {page for page in laid_out if page.startswith(("files/", "decisions/", "reference/"))}
    assert named <= laid_out
    assert laid_out - led_to - named == set()


def test_every_link_of_a_page_leads_to_a_page(pages):
    for page in pages.rglob("*.md"):
        for target in re.findall(r"\]\((?!\w+:|#)([^)#\s]+)", page.read_text()):
            if not page.is_relative_to(pages / "files"):
                assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_a_file_that_a_page_links_to_is_shown(pages):
    shown = (pages / "files/config/autopilot/ardurover.parm.md").read_text()
    assert (ROOT / "config/autopilot/ardurover.parm").read_text().rstrip() in shown


def test_the_reference_has_every_module_once(pages):
    named = re.findall(
        r"^::: twinscrew\.(\S+)$",
        "\n".join(page.read_text() for page in (pages / "reference").glob("*.md")),
        re.MULTILINE,
    )
    assert len(named) == len(set(named))
    for folder in ("runtime", "hil_sim", "training", "export"):
        for file in (ROOT / folder).rglob("[a-z]*.py"):
            name = ".".join(file.relative_to(ROOT).with_suffix("").parts)
            is_command = {"commands", "bench"} & set(file.parts) or file.stem.startswith(
                ("commands", "bench")
            )
            assert is_command or name in named, f"{name} is not in the reference"


def test_every_command_is_in_the_reference(pages, stage):
    words = (pages / "reference/commands.md").read_text()
    assert "`--scenario <str>`" in words
    assert {"sitl", "view", "run"} <= set(re.findall(r"^## (\S+)$", words, re.MULTILINE))


def test_a_link_that_leads_nowhere_is_told(stage, tmp_path, monkeypatch):
    docs = tmp_path / "docs"
    shutil.copytree(ROOT / "docs" / "decisions", docs / "decisions")
    (docs / "page.md").write_text("# Page\n[gone](../config/none.toml), [out](../../other)\n")
    monkeypatch.setattr(stage, "ROOT", tmp_path)
    monkeypatch.setattr(stage, "DOCS", docs)
    site = stage.Site(tmp_path / "pages")
    site.add(docs / "page.md")
    assert len(site.broken) == 2
    assert "docs/page.md" in site.broken[0]
    assert "../config/none.toml" in site.broken[0]
