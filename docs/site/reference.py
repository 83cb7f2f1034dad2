"""The API reference's pages: one a package, each of its modules with its docstrings."""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGES = ("runtime", "hil_sim", "training", "export")
PASSED_OVER = ("commands", "bench")
"""Folders whose functions are commands: `twinscrew COMMAND --help` is their reference."""


def reference_pages(root: Path) -> dict[str, str]:
    """Give the pages: where, and in which words."""
    folders = [
        folder
        for package in PACKAGES
        for folder in (root / package, *sorted((root / package).rglob("*")))
        if (folder / "__init__.py").is_file() and not set(PASSED_OVER) & set(folder.parts)
    ]
    pages = {f"reference/{dotted(root, folder)}.md": page(root, folder) for folder in folders}
    pages["reference/index.md"] = index(root, folders)
    return pages


def page(root: Path, folder: Path) -> str:
    """Give a package's page."""
    parts = [f"# {dotted(root, folder)}", first_words(folder / "__init__.py")]
    parts += [f"::: twinscrew.{dotted(root, module)}" for module in modules(folder)]
    return "\n\n".join(parts) + "\n"


def index(root: Path, folders: list[Path]) -> str:
    """Give the page that leads to the others."""
    lines = ["# API reference", "", "From the docstrings. Import as `twinscrew.runtime...`.", ""]
    lines += ["| package | holds |", "| --- | --- |"]
    for folder in folders:
        name = dotted(root, folder)
        lines.append(f"| [{name}]({name}.md) | {first_words(folder / '__init__.py')} |")
    return "\n".join(lines) + "\n"


def modules(folder: Path) -> list[Path]:
    """Give a package's own modules."""
    files = sorted(folder.glob("[a-z]*.py"))
    return [file for file in files if not file.stem.startswith(PASSED_OVER)]


def dotted(root: Path, path: Path) -> str:
    """Give a module's or a package's name under `twinscrew`."""
    return ".".join(path.relative_to(root).with_suffix("").parts)


def first_words(file: Path) -> str:
    """Give a module's docstring."""
    return ast.get_docstring(ast.parse(file.read_text())) or ""
