"""What the shipped configurations promise: who has no certificate gets nothing."""

import shutil
import socket
import subprocess
import time
from pathlib import Path

import pytest

from twinscrew.runtime.bus.inbox import Inbox
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.bus.zenoh_config import ZenohSettings
from twinscrew.runtime.errors import BusError
from twinscrew.runtime.settings import CONFIG_DIR

ZENOH = CONFIG_DIR / "zenoh"
INSTALLED = "/etc/twinscrew/zenoh"

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    """Give two folders of certificates, ours and those of somebody who made his own."""
    folders = [tmp_path_factory.mktemp(name) for name in ("ours", "theirs")]
    for folder in folders:
        names = ["boat", "127.0.0.1", "sensors", "operator"]
        subprocess.run([ZENOH / "make_certificates.sh", folder, *names], check=True)
    return folders


@pytest.fixture
def port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def installed(shipped, certificates, port, name):
    """Give a shipped configuration with this machine's folder, address and certificate."""
    text = (ZENOH / shipped).read_text()
    assert INSTALLED in text
    for old, new in (
        (INSTALLED, str(certificates)),
        ("0.0.0.0:7447", f"127.0.0.1:{port}"),
        ("192.168.2.2:7447", f"127.0.0.1:{port}"),
        ("operator.pem", f"{name}.pem"),
        ("operator.key", f"{name}.key"),
    ):
        text = text.replace(old, new)
    file = Path(certificates) / f"{name}-{port}.json5"
    file.write_text(text)
    return ZenohSettings(config_file=str(file))


@pytest.fixture
def boat(certificates, port):
    bus = ZenohBus(installed("boat.json5", certificates[0], port, "boat"), "wamv")
    yield bus
    bus.close()


@pytest.fixture
def join(certificates, port, boat):
    """Give a function that connects to the boat by name, with our certificates or another's."""
    joined = []

    def connect(name, folder=0):
        settings = installed("operator.json5", certificates[folder], port, name)
        joined.append(ZenohBus(settings, "wamv"))
        return joined[-1]

    yield connect
    for bus in joined:
        bus.close()


def first(inbox, timeout_s=20.0):
    deadline_s = time.monotonic() + timeout_s
    while time.monotonic() < deadline_s:
        for message in inbox.wait(0.2):
            return message.topic, message.payload
    return None


def test_the_sensors_may_give_scans_but_no_goals(boat, join):
    inbox = Inbox()
    inbox.listen(boat, ("points", "goal"))
    sensors = join("sensors")
    assert sensors.wait_for_subscribers(("points",), 20)
    assert not sensors.wait_for_subscribers(("goal",), 0.3)
    sensors.publish("goal", b"to the rocks")
    sensors.publish("points", b"scan")
    assert first(inbox) == ("points", b"scan")
    assert inbox.wait(0.2) == []


def test_an_operator_may_give_goals_and_look_but_gives_no_scans(boat, join):
    inbox, watching = Inbox(), Inbox()
    inbox.listen(boat, ("points", "goal"))
    operator = join("operator")
    watching.listen(operator, ("decision",))
    assert boat.wait_for_subscribers(("decision",), 20)
    assert operator.wait_for_subscribers(("goal",), 20)
    assert not operator.wait_for_subscribers(("points",), 0.3)
    boat.publish("decision", b"ahead")
    operator.publish("points", b"ghosts")
    operator.publish("goal", b"home")
    assert first(watching) == ("decision", b"ahead")
    assert first(inbox) == ("goal", b"home")
    assert inbox.wait(0.2) == []


def test_the_sensors_may_not_look(boat, join):
    inbox, watching = Inbox(), Inbox()
    inbox.listen(boat, ("points",))
    sensors = join("sensors")
    watching.listen(sensors, ("decision",))
    assert sensors.wait_for_subscribers(("points",), 20)
    assert not boat.wait_for_subscribers(("decision",), 0.3)
    boat.publish("decision", b"secret")
    assert watching.wait(0.3) == []


def test_certificates_of_another_authority_do_not_connect(join):
    with pytest.raises(BusError, match=r"cannot be opened \(client, .*connecting to"):
        join("operator", folder=1)


def test_without_tls_nobody_connects(boat, port):
    for endpoint in (f"tcp/127.0.0.1:{port}", f"tls/127.0.0.1:{port}"):
        with pytest.raises(BusError, match=r"cannot be opened \(client, .*connecting to"):
            ZenohBus(ZenohSettings(mode="client", connect=(endpoint,)), "wamv")


def test_keys_are_readable_by_their_owner_only(certificates):
    for key in certificates[0].glob("*.key"):
        assert key.stat().st_mode & 0o077 == 0
