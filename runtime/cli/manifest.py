"""`twinscrew manifest`: writes, signs and checks the list of files that a runtime may read."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    help="Write, sign and check the list of files that a boat's runtime may read.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
List = Annotated[Path, typer.Argument(help="The manifest.")]
PUBLIC, SECRET = "twinscrew.pub", "twinscrew.key"


@app.command()
def write(
    config: Annotated[Path, typer.Option(help="The vessel's TOML file.")],
    out: Annotated[
        Path | None, typer.Option(help="The manifest; manifest.toml beside the file without it.")
    ] = None,
    also: Annotated[
        list[Path] | None, typer.Option(help="Another file to list; as often as you like.")
    ] = None,
) -> None:
    """Write the SHA-256 of every file that a configuration leads to, as they are now."""
    from twinscrew.runtime.errors import ConfigError
    from twinscrew.runtime.integrity.manifest import manifest_text
    from twinscrew.runtime.vessel.approval import files_of
    from twinscrew.runtime.vessel.config import load_config

    path = out or config.parent / "manifest.toml"
    files = {*files_of(config, load_config(config)), *(also or ())}
    try:
        path.write_text(manifest_text(path, files), encoding="utf-8")
        path.chmod(0o644)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error
    print(f"{path}: {len(files)} files")


@app.command()
def keys(
    folder: Annotated[Path, typer.Argument(help="Where to; keep it off the boat.")],
) -> None:
    """Make two keys: twinscrew.key signs and stays ashore, twinscrew.pub goes to the boats."""
    from twinscrew.runtime.integrity.minisign import make_key, write_keys

    secret = make_key()
    folder.mkdir(parents=True, exist_ok=True)
    write_keys(secret, folder / SECRET, folder / PUBLIC)
    print(f"key {secret.public.name}: {folder / SECRET}, {folder / PUBLIC}")


@app.command()
def sign(
    manifest: List,
    key: Annotated[Path, typer.Option(help="The secret key, of `keys` or of minisign -G -W.")],
    comment: Annotated[
        str, typer.Option(help="What you sign beside it; the time without it.")
    ] = "",
) -> None:
    """Sign a manifest, after comparing every file with it; minisign -S does the same."""
    from twinscrew.runtime.errors import ConfigError
    from twinscrew.runtime.integrity import minisign
    from twinscrew.runtime.vessel.approval import check_manifest

    secret = minisign.read_secret_key(key)
    approval, _ = check_manifest(manifest, None)
    words = comment or datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    signature = manifest.with_name(manifest.name + minisign.SUFFIX)
    try:
        signature.write_text(minisign.sign(manifest.read_bytes(), secret, words), encoding="utf-8")
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=signature) from error
    print(f"{signature}: {approval.files} files, key {secret.public.name}")


@app.command()
def verify(
    manifest: List,
    public_key: Annotated[
        Path | None, typer.Option(help="The key that must have signed it.")
    ] = None,
    config: Annotated[
        Path | None, typer.Option(help="Every file that this leads to must be listed.")
    ] = None,
) -> None:
    """Compare every file with its hash; exit status 2, and which one it is, if one has changed."""
    from twinscrew.runtime.vessel.approval import check_manifest, load_approved

    approval, _ = check_manifest(manifest, public_key)
    if config is not None:
        load_approved(config, manifest, public_key)
    print(approval)
