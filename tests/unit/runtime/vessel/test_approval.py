"""Only approved files are read: the manifest, its signature, and that no file escapes it."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from twinscrew.runtime.bus.zenoh import zenoh_config
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.files import only_approved
from twinscrew.runtime.integrity.manifest import manifest_text
from twinscrew.runtime.integrity.minisign import make_key, sign, write_keys
from twinscrew.runtime.policy.load import load_policy
from twinscrew.runtime.settings import CONFIG_DIR
from twinscrew.runtime.vessel.approval import check_manifest, files_of, load_approved
from twinscrew.runtime.vessel.config import load_config
from twinscrew.runtime.vessel.vessel import make_vessel

SECRET = make_key()


class Dock:
    """A boat's folder with a configuration, its own policy file, a manifest and a signature."""

    def __init__(self, folder: Path) -> None:
        self.config = folder / "boat.toml"
        self.policy = folder / "policy.onnx"
        self.zenoh = folder / "zenoh.json5"
        self.manifest = folder / "manifest.toml"
        self.signature = folder / "manifest.toml.minisig"
        self.public_key = folder / "fleet.pub"
        shutil.copy(CONFIG_DIR / "policies" / "ac_iqn.onnx", self.policy)
        self.zenoh.write_text("{}")
        write_keys(SECRET, folder / "fleet.key", self.public_key)
        self.configure()

    def configure(self, more: str = "") -> None:
        """Write the configuration, and approve it."""
        self.config.write_text(
            f'policy = "{self.policy}"\n[bus]\nconfig_file = "{self.zenoh}"\n{more}'
        )
        self.approve()

    def approve(self) -> None:
        files = files_of(self.config, load_config(self.config))
        self.manifest.write_text(manifest_text(self.manifest, files))
        self.manifest.chmod(0o644)
        self.signature.write_text(sign(self.manifest.read_bytes(), SECRET, "sea trial"))


@pytest.fixture
def dock(tmp_path: Path) -> Dock:
    return Dock(tmp_path)


def test_approved_files_are_read_and_the_approval_says_whose_word_it_is(dock: Dock) -> None:
    approved = load_approved(dock.config, dock.manifest, dock.public_key)
    assert approved.config == load_config(dock.config)
    assert approved.approval is not None
    assert approved.approval.files == 6
    words = str(approved.approval)
    assert words.startswith("6 files as in the manifest ")
    assert words.endswith(f", signed with {SECRET.public.name} (sea trial)")


def test_without_a_manifest_nothing_is_asked(dock: Dock) -> None:
    dock.manifest.unlink()
    assert load_approved(dock.config).approval is None


def test_a_manifest_may_do_without_a_signature_but_says_so(dock: Dock) -> None:
    dock.signature.unlink()
    approval = load_approved(dock.config, dock.manifest).approval
    assert str(approval).endswith(", not signed")


@pytest.mark.parametrize("name", ["config", "policy", "zenoh"])
def test_a_changed_file_is_refused_by_name_with_what_was_expected_and_found(
    dock: Dock, name: str
) -> None:
    file: Path = getattr(dock, name)
    with file.open("ab") as content:
        content.write(b"\n")
    words = rf"{file.name} has changed: SHA-256 expected \w{{64}}, found \w{{64}}"
    with pytest.raises(ConfigError, match=words):
        load_approved(dock.config, dock.manifest, dock.public_key)


def test_a_changed_configuration_is_refused_before_it_is_understood(dock: Dock) -> None:
    dock.config.write_text("this is no TOML at all")
    with pytest.raises(ConfigError, match=r"boat\.toml has changed"):
        load_approved(dock.config, dock.manifest)


def test_a_configuration_that_leads_to_a_file_nobody_approved_is_refused(dock: Dock) -> None:
    other = dock.policy.with_name("other.onnx")
    shutil.copy(dock.policy, other)
    dock.config.write_text(f'policy = "{other}"\n')
    dock.manifest.write_text(manifest_text(dock.manifest, [dock.config]))
    with pytest.raises(ConfigError, match=r"does not list .*other\.onnx"):
        load_approved(dock.config, dock.manifest)


def test_another_boats_configuration_is_not_approved_by_this_ones_manifest(dock: Dock) -> None:
    other = dock.config.with_name("other.toml")
    shutil.copy(dock.config, other)
    with pytest.raises(ConfigError, match=r"does not list .*other\.toml"):
        load_approved(other, dock.manifest)


def test_where_a_key_is_given_an_unsigned_manifest_is_refused(dock: Dock) -> None:
    dock.signature.unlink()
    with pytest.raises(ConfigError, match=r"manifest\.toml\.minisig: No such file"):
        load_approved(dock.config, dock.manifest, dock.public_key)


def test_a_manifest_that_was_changed_to_fit_is_refused_because_of_its_signature(
    dock: Dock,
) -> None:
    dock.config.write_text(dock.config.read_text() + "# evil\n")
    files = files_of(dock.config, load_config(dock.config))
    dock.manifest.write_text(manifest_text(dock.manifest, files))
    load_approved(dock.config, dock.manifest)
    with pytest.raises(ConfigError, match="the signature is not over this file"):
        load_approved(dock.config, dock.manifest, dock.public_key)


def test_a_manifest_signed_with_another_key_is_refused(dock: Dock) -> None:
    thief = make_key()
    dock.signature.write_text(sign(dock.manifest.read_bytes(), thief, ""))
    with pytest.raises(ConfigError, match=f"made with key {thief.public.name}, trusted is"):
        load_approved(dock.config, dock.manifest, dock.public_key)


def test_an_unsigned_manifest_that_others_may_change_is_not_trusted(dock: Dock) -> None:
    dock.manifest.chmod(0o666)
    with pytest.raises(ConfigError, match=r"manifest\.toml: others may change this file"):
        check_manifest(dock.manifest, None)
    check_manifest(dock.manifest, dock.public_key)  # a signature tells


def test_the_configuration_itself_may_ask_for_a_manifest_and_a_key(dock: Dock) -> None:
    dock.configure('[integrity]\nmanifest = "manifest.toml"\npublic_key = "fleet.pub"\n')
    approval = load_approved(dock.config).approval
    assert approval is not None
    assert approval.key == SECRET.public.name
    dock.signature.unlink()
    with pytest.raises(ConfigError, match="minisig"):
        load_approved(dock.config)


def test_the_command_line_has_the_last_word(dock: Dock) -> None:
    """Whoever can change the configuration cannot talk the unit's options away."""
    dock.configure('[integrity]\nmanifest = ""\n')
    dock.policy.write_bytes(b"evil")
    assert load_approved(dock.config).approval is None
    with pytest.raises(ConfigError, match=r"policy\.onnx has changed"):
        load_approved(dock.config, dock.manifest, dock.public_key)


def test_a_key_without_a_manifest_is_refused(dock: Dock) -> None:
    with pytest.raises(ConfigError, match="no manifest"):
        load_approved(dock.config, None, dock.public_key)
    dock.configure('[integrity]\npublic_key = "fleet.pub"\n')
    with pytest.raises(ConfigError, match="no manifest"):
        load_approved(dock.config)


def test_a_manifest_that_is_not_there_is_named(dock: Dock) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml: No such file"):
        load_approved(dock.config, dock.config.with_name("none.toml"))


def test_what_is_read_after_the_check_is_what_was_checked(dock: Dock) -> None:
    approved = load_approved(dock.config, dock.manifest, dock.public_key)
    checked = hashlib.sha256(dock.policy.read_bytes()).hexdigest()
    for file in (dock.config, dock.policy, dock.zenoh):
        file.write_bytes(b"evil")
    with only_approved(approved.contents):
        policy = make_vessel(approved.config).pipeline.policy
        zenoh_config(approved.config.bus)
        assert load_config(dock.config) == approved.config
    assert policy.sha256 == checked
    with pytest.raises(ConfigError, match="not a Zenoh configuration"):
        zenoh_config(approved.config.bus)


def test_a_configuration_that_asks_for_a_manifest_itself_is_the_one_that_is_compared(
    dock: Dock,
) -> None:
    """A pipe shows another content to the first who reads than to those after him."""
    dock.configure('[integrity]\nmanifest = "manifest.toml"\n')
    approved = dock.config.read_bytes()
    dock.config.unlink()
    os.mkfifo(dock.config)

    def write() -> None:
        for content in (approved + b"# evil", approved):
            dock.config.write_bytes(content)
            time.sleep(0.1)  # or the same reader would have both

    threading.Thread(target=write, daemon=True).start()
    with pytest.raises(ConfigError, match=r"boat\.toml has changed"):
        load_approved(dock.config)


def test_a_file_that_nobody_approved_is_not_read_at_all(dock: Dock) -> None:
    approved = load_approved(dock.config, dock.manifest)
    other = dock.policy.with_name("other.onnx")
    shutil.copy(dock.policy, other)
    with (
        only_approved(approved.contents),
        pytest.raises(ConfigError, match=r"other\.onnx: is read, but nobody approved it"),
    ):
        load_policy(other)
    load_policy(other)


WATCHED = """
import json, sys
from pathlib import Path

opened = set()
sys.addaudithook(lambda event, args: opened.add(args[0]) if event == "open" else None)
from twinscrew.runtime.vessel.approval import load_approved
from twinscrew.runtime.vessel.vessel import make_vessel

make_vessel(load_approved(Path(sys.argv[1])).config).pipeline.warm_up()
files = {Path(file).resolve() for file in opened if isinstance(file, str)}
kinds = (".toml", ".onnx", ".parm", ".json", ".json5")
print(json.dumps([str(file) for file in files if file.suffix in kinds]))
"""


@pytest.mark.parametrize("policy", ["own", "ac_iqn", "apf", "mpc"])
def test_every_file_that_a_runtime_opens_to_be_assembled_is_one_that_a_manifest_lists(
    dock: Dock, policy: str
) -> None:
    if policy != "own":
        dock.config.write_text(
            f'policy = "{policy}"\nsensor = "vlp16"\n[mount]\nx_m = 0.7\ny_m = 0.0\nz_m = 1.8\n'
        )
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, str(dock.config)],
        capture_output=True,
        text=True,
        check=True,
    )
    opened = {Path(file) for file in json.loads(done.stdout)}
    listed = {file.resolve() for file in files_of(dock.config, load_config(dock.config))}
    assert opened - listed == set()
    assert listed - opened == ({dock.zenoh} if policy == "own" else set())
