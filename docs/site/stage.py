"""Lay out the pages of the documentation site: python docs/site/stage.py [FOLDER].

Pages are docs/*.md, docs/results/*.md, the README (the first page), CONTRIBUTING and CHANGELOG, a
page for every file or folder outside of docs/ that they link to, and a reference: the commands, and
the packages by their docstrings. A link to what does not exist ends it with status 1.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

from command_line import commands_page
from reference import reference_pages

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PLACES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
"""Pages from outside of docs/, and what the site calls them."""
LINK = re.compile(r"(?<=\]\()(?!\w+:|#)([^)#\s]+)")
"""Where a link or an image of Markdown leads, if that is a file of ours."""
LANGUAGES = {
    ".toml": "toml",
    ".py": "python",
    ".cpp": "cpp",
    ".hpp": "cpp",
    ".sh": "bash",
    ".json5": "json",
}
SHOWN = {"", ".parm", ".service", ".md", ".csv", ".cnf", *LANGUAGES}
"""Files that a folder's page shows; it names the others."""


class Site:
    """The pages so far, and what is left to show because a page links to it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.broken: list[str] = []
        self._wanted: set[Path] = set()

    def write(self, place: str, words: str) -> None:
        """Write a page."""
        page = self.folder / place
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(words)

    def add(self, source: Path) -> None:
        """Add a page of ours, its links turned to where the site has what they lead to."""
        place = place_of(source)

        def turned(match: re.Match[str]) -> str:
            target = (source.parent / match[1]).resolve()
            if not target.exists() or not target.is_relative_to(ROOT):
                self.broken.append(f"{source.relative_to(ROOT)}: no such file: {match[1]}")
                return match[1]
            if not target.is_relative_to(DOCS) and str(target.relative_to(ROOT)) not in PLACES:
                self._wanted.add(target)
            up = "../" * place.count("/")
            return up + place_of(target)

        self.write(place, LINK.sub(turned, source.read_text()))

    def show(self) -> None:
        """Add pages for what is linked to and is no page by itself."""
        for path in sorted(self._wanted):
            self.write(place_of(path), shown(path))


def place_of(path: Path) -> str:
    """Give where the site has a file or a folder of the repository."""
    name = path.relative_to(ROOT).as_posix()
    if name in PLACES:
        return PLACES[name]
    if path.is_relative_to(DOCS):
        inside = path.relative_to(DOCS).as_posix()
        return f"{inside}/index.md" if path.is_dir() else inside
    return f"files/{name}.md"


def shown(path: Path) -> str:
    """Give a page that shows a file, or the files of a folder."""
    name = path.relative_to(ROOT)
    if path.is_file():
        return f"# {name}\n\n{fenced(path)}"
    files = sorted(file for file in path.iterdir() if file.is_file())
    parts = [f"## {file.name}\n\n{fenced(file)}" for file in files if file.suffix in SHOWN]
    others = ", ".join(f"`{file.name}`" for file in files if file.suffix not in SHOWN)
    return "\n".join([f"# {name}/\n", *parts, f"Also here: {others}.\n" if others else ""])


def fenced(file: Path) -> str:
    """Give a file's words as a block of code."""
    return f"````{LANGUAGES.get(file.suffix, 'text')}\n{file.read_text().rstrip()}\n````\n"


def contents(title: str, folder: Path) -> str:
    """Give a folder's table of contents: the first line of each of its pages."""
    lines = [
        f"- [{page.read_text().splitlines()[0].lstrip('# ')}]({page.name})"
        for page in pages_in(folder)
    ]
    return "\n".join([f"# {title}\n", *lines, ""])


def pages_in(folder: Path) -> list[Path]:
    """Give a folder's pages by name."""
    return sorted(folder.glob("*.md"))


def stage(folder: Path) -> list[str]:
    """Lay out the whole site anew; give the links that lead nowhere."""
    shutil.rmtree(folder, ignore_errors=True)
    for beside in ("images", "data"):
        shutil.copytree(DOCS / beside, folder / beside)
    site = Site(folder)
    for source in (
        *(ROOT / name for name in PLACES),
        *pages_in(DOCS),
        *pages_in(DOCS / "decisions"),
        *pages_in(DOCS / "results"),
    ):
        site.add(source)
    site.show()
    site.write("decisions/index.md", contents("Decisions", DOCS / "decisions"))
    for place, words in reference_pages(ROOT).items():
        site.write(place, words)
    site.write("reference/commands.md", commands_page())
    return site.broken


if __name__ == "__main__":
    broken = stage(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "docs" / "pages")
    if broken:
        sys.exit("\n".join(broken))
