"""`twinscrew signing`: makes the key that signs MAVLink frames, and puts it into an autopilot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    help="Make the key that signs MAVLink frames, and put it into an autopilot.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
STEP_S = 0.05


@app.command()
def make(
    key: Annotated[Path, typer.Argument(help="The new file; only its owner may read it.")],
) -> None:
    """Make a key: 32 bytes of chance in a new file."""
    import os
    import secrets

    from twinscrew.runtime.errors import ConfigError
    from twinscrew.runtime.mavlink import KEY_LENGTH

    try:
        file = os.open(key, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(file, "wb") as opened:
            opened.write(secrets.token_bytes(KEY_LENGTH))
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=key) from error
    print(f"{key}: a new key; give it to the runtime as autopilot.signing_key_file")


@app.command()
def setup(
    key: Annotated[Path, typer.Option(help="The key to put in, of `make`.")],
    connection: Annotated[
        str, typer.Option(help="The line to the autopilot, as serial:/dev/ttyACM0:115200: a cable.")
    ],
    system_id: Annotated[int, typer.Option(help="The vehicle's.", min=1, max=255)] = 1,
    old_key: Annotated[
        Path | None, typer.Option(help="The key that it signs with now, if it does.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask for confirmation.")] = False,
) -> None:
    """Put a key into the autopilot (SETUP_SIGNING), once, and look whether it signs with it.

    The key goes over the line in the clear. From then on the autopilot refuses what is not signed
    with it on every port but its first (USB): every ground station needs it, too.
    """
    import time

    from twinscrew.runtime.errors import LinkError
    from twinscrew.runtime.link.ardupilot.key_setup import KeySetup, Step
    from twinscrew.runtime.link.ardupilot.settings import AutopilotSettings
    from twinscrew.runtime.link.transport import open_transport
    from twinscrew.runtime.mavlink import Signing, read_key

    new, old = Signing(read_key(key)), Signing(read_key(old_key)) if old_key else None
    if not yes:
        question = f"Send the key in the clear over {connection} to vehicle {system_id}?"
        typer.confirm(question, abort=True)
    task = KeySetup(new, system_id, AutopilotSettings().component_id, old)
    with open_transport(connection) as transport:
        while not task.over:
            transport.send(task.go(transport.receive(), time.monotonic()))
            time.sleep(STEP_S)
    if task.step is Step.REFUSED:
        raise LinkError(f"{connection}: {task.why}")
    print(task.step.value)
