import hashlib
from pathlib import Path

import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.integrity.manifest import Manifest, manifest_text, read_manifest
from twinscrew.runtime.settings import CONFIG_DIR

SENSOR = CONFIG_DIR / "sensors" / "vrx16.toml"


@pytest.fixture
def boat(tmp_path: Path) -> Path:
    """A boat's folder, with a file below it and one outside."""
    (tmp_path / "boat" / "zenoh").mkdir(parents=True)
    for name in ("boat/boat.toml", 'boat/zenoh/it\'s a "tls".json5', "policy.onnx"):
        (tmp_path / name).write_text(name)
    return tmp_path / "boat"


def files(boat: Path) -> list[Path]:
    below = boat / "zenoh" / 'it\'s a "tls".json5'
    return [boat / "boat.toml", below, boat.parent / "policy.onnx", SENSOR]


def listed(boat: Path) -> Manifest:
    path = boat / "manifest.toml"
    return read_manifest(path, manifest_text(path, files(boat)).encode())


def test_what_was_listed_is_as_it_was(boat: Path) -> None:
    manifest = listed(boat)
    manifest.check()
    manifest.require(files(boat))
    assert manifest.files[SENSOR.resolve()] == hashlib.sha256(SENSOR.read_bytes()).hexdigest()


def test_files_are_named_so_that_the_boats_folder_and_the_package_may_lie_elsewhere(
    boat: Path,
) -> None:
    text = manifest_text(boat / "manifest.toml", files(boat))
    names = [line.rpartition(" = ")[0] for line in text.splitlines() if "= " in line][1:]
    outside = str(boat.parent / "policy.onnx")
    below = '"zenoh/it\'s a \\"tls\\".json5"'
    assert names == [f'"{outside}"', '"boat.toml"', '"shipped:sensors/vrx16.toml"', below]
    moved = boat.rename(boat.parent / "other")
    manifest = read_manifest(moved / "manifest.toml", text.encode())
    manifest.check()
    manifest.require(files(moved))


def test_the_same_files_give_the_same_text_in_any_order(boat: Path) -> None:
    path = boat / "manifest.toml"
    assert manifest_text(path, files(boat)) == manifest_text(path, reversed(files(boat)))


def test_every_changed_and_missing_file_is_named_with_what_was_expected_and_found(
    boat: Path,
) -> None:
    manifest = listed(boat)
    (boat / "boat.toml").write_text("changed")
    (boat.parent / "policy.onnx").unlink()
    with pytest.raises(ConfigError) as caught:
        manifest.check()
    expected, found = (hashlib.sha256(text).hexdigest() for text in (b"boat/boat.toml", b"changed"))
    words = f"{boat / 'boat.toml'} has changed: SHA-256 expected {expected}, found {found}"
    assert words in str(caught.value)
    assert "policy.onnx: No such file" in str(caught.value)
    assert "json5" not in str(caught.value)


def test_a_link_to_another_file_does_not_pass_as_the_listed_one(boat: Path) -> None:
    manifest = listed(boat)
    (boat / "evil.toml").write_text("evil")
    (boat / "boat.toml").unlink()
    (boat / "boat.toml").symlink_to(boat / "evil.toml")
    with pytest.raises(ConfigError, match="does not list"):
        manifest.require([boat / "boat.toml"])


def test_a_file_that_is_not_listed_is_named(boat: Path) -> None:
    (boat / "more.toml").write_text("")
    with pytest.raises(ConfigError, match=r"manifest\.toml: does not list .*more\.toml"):
        listed(boat).require([*files(boat), boat / "more.toml"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("not TOML", "not TOML"),
        ("format = 2\n[files]", "format"),
        ("format = 1", "files"),
        ('format = 1\n[files]\n"a" = "12"', "files"),
        (f'format = 1\n[files]\n"a" = "{"G" * 64}"', "files"),
        ("format = 1\nfile = 3\n[files]", "file: unknown key"),
    ],
)
def test_what_is_no_manifest_is_refused(boat: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=rf"manifest\.toml: .*{words}"):
        read_manifest(boat / "manifest.toml", text.encode())


def test_a_file_that_cannot_be_read_cannot_be_listed(boat: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml: No such file"):
        manifest_text(boat / "manifest.toml", [boat / "none.toml"])
