"""A manifest: the SHA-256 of every file that a runtime reads, as somebody approved them.

A TOML file, so that people can read what was approved. Files in its folder, or below, are named
from there; shipped ones by `shipped:`, wherever the package is installed; others by their path.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

from msgspec import Meta

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.files import read_file
from twinscrew.runtime.settings import CONFIG_DIR, Settings, parse

SHIPPED: Final = "shipped:"
Sha256 = Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]


class ManifestFile(Settings, frozen=True):
    """A manifest as it is written."""

    format: Literal[1]
    files: dict[str, Sha256]
    """SHA-256, in hexadecimal digits, by name."""


@dataclass(frozen=True, slots=True)
class Manifest:
    """What was approved."""

    path: Path
    """The manifest's file; names are relative to its folder."""
    sha256: str
    """The manifest's own."""
    files: dict[Path, str]
    """SHA-256 by absolute path."""

    def check(self) -> None:
        """Compare every listed file with its hash.

        Raises
        ------
        ConfigError
            Names each file that is missing or has changed, with both hashes.
        """
        wrong = [words for path, sha256 in self.files.items() if (words := _compare(path, sha256))]
        if wrong:
            raise ConfigError("; ".join(wrong), file=self.path)

    def read(self, path: Path) -> bytes:
        """Read a listed file once, and give what was read if it is as approved.

        Raises
        ------
        ConfigError
            It is not listed, cannot be read, or has changed.
        """
        self.require([path])
        content = _read(path)
        self.compare(path, content)
        return content

    def compare(self, path: Path, content: bytes) -> None:
        """Check what was read of a listed file; errors as `read`."""
        self.require([path])
        words = _differs(path, self.files[path.resolve()], hashlib.sha256(content).hexdigest())
        if words:
            raise ConfigError(words, file=self.path)

    def require(self, paths: Iterable[Path]) -> None:
        """Check that files are listed.

        Raises
        ------
        ConfigError
            Names those that are not.
        """
        missing = [str(path) for path in paths if path.resolve() not in self.files]
        if missing:
            raise ConfigError(f"does not list {', '.join(missing)}", file=self.path)


def read_manifest(path: Path, content: bytes) -> Manifest:
    """Understand a manifest's content, which was read from `path`.

    Raises
    ------
    ConfigError
        It is not a manifest.
    """
    read = parse(content, ManifestFile, file=path)
    files = {_path_of(name, path): sha256 for name, sha256 in read.files.items()}
    return Manifest(path, hashlib.sha256(content).hexdigest(), files)


def manifest_text(path: Path, files: Iterable[Path]) -> str:
    """Give the text of a manifest of files as they are now, to be written to `path`.

    Raises
    ------
    ConfigError
        A file cannot be read.
    """
    hashes = {_name_of(file.resolve(), path): sha256_of(file) for file in files}
    lines = [f"{json.dumps(name)} = {json.dumps(hashes[name])}" for name in sorted(hashes)]
    head = ["# What a runtime may read: SHA-256 by file (`twinscrew manifest`).", "format = 1", ""]
    return "\n".join([*head, "[files]", *lines, ""])


def sha256_of(path: Path) -> str:
    """Give a file's SHA-256."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error


def _compare(path: Path, sha256: str) -> str:
    """Say what is wrong with a file; nothing if it is as approved."""
    try:
        found = sha256_of(path)
    except ConfigError as error:
        return str(error)
    return _differs(path, sha256, found)


def _differs(path: Path, expected: str, found: str) -> str:
    if found == expected:
        return ""
    return f"{path} has changed: SHA-256 expected {expected}, found {found}"


def _name_of(file: Path, manifest: Path) -> str:
    folder = manifest.resolve().parent
    if file.is_relative_to(CONFIG_DIR):
        return SHIPPED + file.relative_to(CONFIG_DIR).as_posix()
    return file.relative_to(folder).as_posix() if file.is_relative_to(folder) else str(file)


def _path_of(name: str, manifest: Path) -> Path:
    if name.startswith(SHIPPED):
        return (CONFIG_DIR / name.removeprefix(SHIPPED)).resolve()
    return (manifest.resolve().parent / name).resolve()


def _read(path: Path) -> bytes:
    try:
        return read_file(path)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error
