"""What the doctor looks at of the files: whether they are the approved ones."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from twinscrew.runtime.app.approval import load_approved
from twinscrew.runtime.app.finding import Finding, fail, ok
from twinscrew.runtime.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Sources:
    """What `run` would be given."""

    config: Path
    manifest: Path | None = None
    public_key: Path | None = None


def check_files(sources: Sources) -> Finding:
    """Compare every file with the manifest, if there is one, as `run` would."""
    try:
        approval = load_approved(sources.config, sources.manifest, sources.public_key).approval
    except ConfigError as error:
        advice = "look at who changed it; approve it anew by `twinscrew manifest write`"
        return fail("files", str(error), advice)
    if approval is None:
        return ok("files", "no manifest: nobody would notice a changed file")
    return ok("files", str(approval))
