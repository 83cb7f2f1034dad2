"""What the shipped configurations promise: who has no certificate gets nothing."""

import json
import shutil
import socket
import subprocess
import time
from pathlib import Path

import pytest
import zenoh

from twinscrew.runtime.bus.base import Inbox
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.errors import BusError
from twinscrew.runtime.messages.topics import TOPICS, Direction, key
from twinscrew.runtime.settings import CONFIG_DIR

ZENOH = CONFIG_DIR / "zenoh"
INSTALLED = "/etc/twinscrew/zenoh"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl"),
]


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    """Give two folders of certificates, ours and those of somebody who made his own."""
    folders = [tmp_path_factory.mktemp(name) for name in ("ours", "theirs")]
    for folder in folders:
        names = ["boat", "127.0.0.1", "sensors", "operator", "stranger"]
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


def test_a_certificate_with_a_name_that_has_no_rights_gives_none(boat, join):
    """The authority's, but for another purpose: it connects, and can do nothing."""
    inbox, watching = Inbox(), Inbox()
    inbox.listen(boat, ("points", "odometry", "goal"))
    stranger, operator = join("stranger"), join("operator")
    watching.listen(stranger, ("decision", "thrust_left", "diagnostics"))
    assert operator.wait_for_subscribers(("goal",), 20)
    for topic in ("points", "odometry", "goal"):
        assert not stranger.wait_for_subscribers((topic,), 0.1)
        stranger.publish(topic, b"from a stranger")
    assert not boat.wait_for_subscribers(("decision",), 0.2)
    for topic in ("decision", "thrust_left", "diagnostics"):
        boat.publish(topic, b"secret")
    operator.publish("goal", b"home")
    assert first(inbox) == ("goal", b"home")
    assert inbox.wait(0.2) == []
    assert watching.wait(0.2) == []


def rogue_settings(kind, certificates, port):
    """What somebody who is no client of ours may try; as a peer, which never gives up."""
    if kind == "plain tcp":
        return ZenohSettings(connect=(f"tcp/127.0.0.1:{port}",))
    if kind == "another authority":
        file = Path(installed("operator.json5", certificates[1], port, "operator").config_file)
        file.write_text(file.read_text().replace('mode: "client"', 'mode: "peer"'))
        return ZenohSettings(config_file=str(file))
    # knows our authority, which is no secret, and so trusts the boat; but has nothing to show
    file = Path(certificates[0]) / f"nothing-{port}.json5"
    file.write_text(
        '{mode: "peer", scouting: {multicast: {enabled: false}}, transport: {link: {tls: '
        f'{{root_ca_certificate: "{certificates[0]}/ca.pem"}}}}}}}}'
    )
    return ZenohSettings(config_file=str(file), connect=(f"tls/127.0.0.1:{port}",))


@pytest.mark.parametrize("kind", ["plain tcp", "no certificate", "another authority"])
def test_a_rogue_peer_can_neither_give_sensors_nor_goals_nor_read(
    kind, certificates, port, boat, join
):
    """It tries all the time while those with rights do their work."""
    inbox, watching, spying = Inbox(), Inbox(), Inbox()
    inbox.listen(boat, ("points", "odometry", "goal"))
    rogue = ZenohBus(rogue_settings(kind, certificates, port), "wamv")
    try:
        spying.listen(rogue, ("decision", "thrust_left", "diagnostics"))
        operator, sensors = join("operator"), join("sensors")
        watching.listen(operator, ("decision",))
        assert boat.wait_for_subscribers(("decision",), 20)
        assert sensors.wait_for_subscribers(("points",), 20)
        assert not rogue.wait_for_subscribers(("goal",), 0.5)
        taken, seen = [], []
        for _ in range(20):
            for topic in ("points", "odometry", "goal"):
                rogue.publish(topic, b"from a rogue")
            sensors.publish("points", b"scan")
            boat.publish("decision", b"ahead")
            taken += [message.payload for message in inbox.wait(0.1)]
            seen += [message.payload for message in watching.wait(0.1)]
        assert set(taken) == {b"scan"}
        assert set(seen) == {b"ahead"}
        assert spying.wait(0.1) == []
    finally:
        rogue.close()


def rules():
    """The shipped rights: which certificate may put which keys."""
    config = zenoh.Config.from_file(ZENOH / "boat.json5")
    control = json.loads(config.get_json("access_control"))
    assert control["enabled"]
    assert control["default_permission"] == "deny"
    named = {rule["id"]: rule for rule in control["rules"]}
    assert all(rule["permission"] == "allow" for rule in named.values())
    rights = {}
    for policy in control["policies"]:
        for name in policy["subjects"]:
            for rule in (named[id_] for id_ in policy["rules"]):
                if "put" in rule["messages"] and "ingress" in rule["flows"]:
                    rights.setdefault(name, []).extend(rule["key_exprs"])
    return rights


@pytest.mark.parametrize("format_", ["ros2dds", "rmw_zenoh"])
@pytest.mark.parametrize("topic", TOPICS.values(), ids=lambda topic: topic.name)
def test_each_input_is_one_certificates_to_give_and_no_output_is_anybodys(topic, format_):
    expr = zenoh.KeyExpr(key(topic, "wamv", format_, domain=7))
    may = {
        name
        for name, granted in rules().items()
        if any(zenoh.KeyExpr(one).includes(expr) for one in granted)
    }
    commands = {name: {"operator"} for name in ("goal", "route", "hold", "berth", "enable")}
    expected = commands.get(topic.name, {"sensors"}) if topic.direction is Direction.IN else set()
    assert may == expected


def test_certificates_of_another_authority_do_not_connect(join):
    with pytest.raises(BusError, match=r"cannot be opened \(client, .*connecting to"):
        join("operator", folder=1)


def test_without_tls_nobody_connects(boat, port):
    for endpoint in (f"tcp/127.0.0.1:{port}", f"tls/127.0.0.1:{port}"):
        with pytest.raises(BusError, match=r"cannot be opened \(client, .*connecting to"):
            ZenohBus(ZenohSettings(mode="client", connect=(endpoint,)), "wamv")


def test_strangers_at_the_port_do_not_keep_those_with_rights_out(boat, join, port):
    """Connections that say nothing, rubbish, or the beginning of a handshake, and stay."""
    inbox, strangers = Inbox(), []
    inbox.listen(boat, ("goal",))
    try:
        for words in (b"", b"\x00" * 100, b"\xff" * 65_536, b"\x16\x03\x01\x02\x00\x01") * 10:
            strangers.append(socket.create_connection(("127.0.0.1", port)))
            strangers[-1].sendall(words)
        operator = join("operator")
        assert operator.wait_for_subscribers(("goal",), 20)
        operator.publish("goal", b"home")
        assert first(inbox) == ("goal", b"home")
    finally:
        for stranger in strangers:
            stranger.close()


def test_an_operator_finds_a_boat_that_starts_again(certificates, port, join, boat):
    operator, heard = join("operator"), []
    boat.close()
    again = ZenohBus(installed("boat.json5", certificates[0], port, "boat"), "wamv")
    inbox = Inbox()
    try:
        inbox.listen(again, ("goal",))
        while not heard:
            operator.publish("goal", b"home")
            heard = inbox.wait(0.1)
        assert heard[0].payload == b"home"
    finally:
        again.close()


@pytest.mark.usefixtures("boat")
@pytest.mark.parametrize("until", ["20200102000000Z", "20600102000000Z"])
def test_a_certificate_that_has_expired_does_not_connect(certificates, port, tmp_path, until):
    """Ours, of our authority, with the operator's rights, but of years ago; a good one does."""
    ours = Path(certificates[0])
    book = tmp_path / "ca.cnf"
    (tmp_path / "index.txt").touch()
    (tmp_path / "serial").write_text("01\n")
    book.write_text(
        f"[ca]\ndefault_ca = d\n[d]\ndatabase = {tmp_path}/index.txt\nserial = {tmp_path}/serial\n"
        f"new_certs_dir = {tmp_path}\ndefault_md = sha256\npolicy = p\nx509_extensions = x\n"
        "[p]\ncommonName = supplied\n"
        "[x]\nsubjectAltName = DNS:localhost,IP:127.0.0.1\n"
        "extendedKeyUsage = serverAuth,clientAuth\n"
    )
    request, old = tmp_path / "old.csr", ours / "expired.pem"
    shutil.copy(ours / "operator.key", ours / "expired.key")
    (ours / "expired.key").chmod(0o600)
    for words in (
        ["req", "-new", "-key", ours / "expired.key", "-subj", "/CN=operator", "-out", request],
        [
            *("ca", "-batch", "-config", book, "-cert", ours / "ca.pem"),
            *("-keyfile", ours / "ca.key", "-in", request, "-out", old),
            *("-startdate", "20200101000000Z", "-enddate", until),
        ],
    ):
        subprocess.run(["openssl", *words], check=True, capture_output=True)
    settings = installed("operator.json5", certificates[0], port, "expired")
    if until.startswith("2060"):
        ZenohBus(settings, "wamv").close()
    else:
        with pytest.raises(BusError):
            ZenohBus(settings, "wamv")


def test_keys_are_readable_by_their_owner_only(certificates):
    for file in certificates[0].glob("*.key"):
        assert file.stat().st_mode & 0o077 == 0
