"""Reads a configuration only if it, and every file that it leads to, is an approved one.

The manifest comes first: nothing of a file is believed before its hash was compared. What the
manifest says of itself is believed if its signature is that of a trusted key, where one is given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.files import read_file, require_unwritable
from twinscrew.runtime.integrity.manifest import Manifest, read_manifest
from twinscrew.runtime.policy.load import PLANNERS
from twinscrew.runtime.settings import MOST_BYTES, parse, shipped
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel_description import DEFAULT


@dataclass(frozen=True, slots=True)
class Approval:
    """What was checked."""

    files: int
    """[-] How many files the manifest lists."""
    manifest_sha256: str
    key: str = ""
    """The name of the key that signed it; empty if nobody had to."""
    comment: str = ""
    """What the signer said, and signed."""

    def __str__(self) -> str:
        signed = f", signed with {self.key} ({self.comment})" if self.key else ", not signed"
        return f"{self.files} files as in the manifest {self.manifest_sha256[:12]}...{signed}"


@dataclass(frozen=True, slots=True)
class Approved:
    """A configuration, and who stands for it."""

    config: RuntimeConfig
    approval: Approval | None
    """None: nobody asked for a manifest."""
    contents: Mapping[Path, bytes] | None = None
    """What was read of the approved files, by absolute path, for `files.only_approved`: they are
    not read again. None: nobody asked for a manifest."""


def load_approved(
    source: Path, manifest: Path | None = None, public_key: Path | None = None
) -> Approved:
    """Read a runtime's configuration, and check it.

    Parameters
    ----------
    source
        The vessel's TOML file.
    manifest, public_key
        Stand in for what the file itself says of them (`IntegritySettings`).

    Raises
    ------
    ConfigError
        The file cannot be used; or a file has changed, is not listed, or is not signed for.
    """
    if manifest is not None:
        approval, listed = check_manifest(manifest, public_key)
        content = listed.read(source)
        config = parse(content, RuntimeConfig, file=source)
    else:
        content = _read(source)
        config = parse(content, RuntimeConfig, file=source)
        asked = config.integrity
        public_key = public_key or _beside(source, asked.public_key)
        manifest = _beside(source, asked.manifest)
        if manifest is None:
            if public_key is not None:
                raise ConfigError("a public key, but no manifest that is signed", file=source)
            return Approved(config, None)
        approval, listed = check_manifest(manifest, public_key)
        listed.compare(source, content)
    files = files_of(source, config)
    listed.require(files)
    contents = {path.resolve(): listed.read(path) for path in files if path != source}
    return Approved(config, approval, contents | {source.resolve(): content})


def check_manifest(path: Path, public_key: Path | None) -> tuple[Approval, Manifest]:
    """Check a manifest's signature, if a key is given, and every file that it lists.

    Raises
    ------
    ConfigError
        It is not signed with the key, others may change it unsigned, or a file has changed.
    """
    content = _read(path)
    key = comment = ""
    if public_key is None:
        require_unwritable(path)
    else:
        # What checks signatures takes 15 ms to import: only boats that want them wait for it.
        from twinscrew.runtime.integrity.minisign import SUFFIX, read_public_key, verify

        trusted = read_public_key(public_key)
        comment = verify(content, path.with_name(path.name + SUFFIX), trusted)
        key = trusted.name
    listed = read_manifest(path, content)
    listed.check()
    return Approval(len(listed.files), listed.sha256, key, comment), listed


def files_of(source: Path, config: RuntimeConfig) -> list[Path]:
    """Give every file that decides what a runtime does: those that it reads at the start.

    Keys and certificates are not among them: they are secrets, or change without anybody's
    approval.
    """
    files = [source, shipped("sensors", config.sensor), _policy(config.policy)]
    files += {shipped("vessels", DEFAULT), shipped("vessels", config.vessel)}
    files.append(shipped("autopilot", "ardurover", ".parm"))
    if config.bus.config_file is not None:
        files.append(Path(config.bus.config_file))
    if config.chart.file:
        files.append(Path(config.chart.file))
    return files


def _read(path: Path) -> bytes:
    try:
        return read_file(path, MOST_BYTES)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error


def _policy(spec: str) -> Path:
    if spec in PLANNERS:
        return shipped("policies", spec)
    return shipped("policies", spec, ".onnx")


def _beside(source: Path, name: str) -> Path | None:
    """Find a file that a configuration names, from the folder that the configuration is in."""
    return source.parent / name if name else None
