"""Two runtimes of one name on one bus: the newcomer ends, the one under way says so and goes on."""

from pathlib import Path

from tests.harness.commands import running
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.drivers.processes import free_port
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.vessel.realtime import Name


def configured(folder: Path, name: str, endpoint: str) -> Path:
    """Give the file of a runtime, which is called as the file is."""
    file = folder / f"{name}.toml"
    file.write_text(
        f'name = "wamv"\n[autopilot]\nconnection = "udpin:127.0.0.1:{free_port()}"\n'
        f'[bus]\nmode = "client"\nconnect = ["{endpoint}"]\n'
    )
    return file


def test_a_second_runtime_of_a_name_ends_and_the_first_says_so_and_goes_on(tmp_path: Path) -> None:
    endpoint, told = f"tcp/127.0.0.1:{free_port()}", []
    router = ZenohSettings(mode="router", listen=(endpoint,), connect=(), node="sensors")
    bus = ZenohBus(router, "wamv")

    def hear(message: Received) -> None:
        told.extend(event.name for event in cdr.decode_diagnostics(message.payload))

    bus.subscribe("diagnostics", hear)
    logs = [tmp_path / "first.txt", tmp_path / "second.txt"]
    files = [configured(tmp_path, name, endpoint) for name in ("first", "second")]
    try:
        with running("run", "--config", files[0], log=logs[0]) as first:
            wait_until(lambda: told.count("state_now") > Name.JUST_STARTED_S)  # once a second
            with running("run", "--config", files[1], log=logs[1]) as second:
                assert second.wait(60) == 2
            assert "another runtime is named 'wamv' on this bus" in logs[1].read_text()
            wait_until(lambda: "name_taken" in told)
            told.clear()
            wait_until(lambda: "state_now" in told)
            assert first.poll() is None
            # and when the second is gone, the name is free for nobody but the first
        with running("run", "--config", files[1], log=logs[1]) as again:
            told.clear()
            wait_until(lambda: told.count("state_now") > Name.JUST_STARTED_S)
            assert again.poll() is None
    finally:
        bus.close()
