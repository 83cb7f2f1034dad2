"""Signatures in minisign's format, against its authors' example and, where it is, its own tool."""

import base64
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.integrity.minisign import (
    SUFFIX,
    make_key,
    read_public_key,
    read_secret_key,
    sign,
    verify,
    write_keys,
)

# The example in the documentation of minisign's implementations: the author's key over "test".
AUTHOR = "untrusted comment: \nRWQf6LRCGA9i53mlYecO4IzT51TGPpvWucNSCh1CBM0QTaLn73Y7GFO3\n"
EXAMPLE = (
    "untrusted comment: signature from minisign secret key\n"
    "RUQf6LRCGA9i559r3g7V1qNyJDApGip8MfqcadIgT9CuhV3EMhHoN1mGTkUidF/z7SrlQgXdy8ofjb7bNJJylDOocrCo8KL"
    "zZwo=\ntrusted comment: timestamp:1633700835\tfile:test\tprehashed\n"
    "wLMDjy9FLAuxZ3q4NlEvkgtyhrr0gtTu6KC4KBJdITbbOeAi1zBIYo0v4iTgt8jJpIidRJnp94ABQkJAgAooBQ==\n"
)
SECRET = make_key()
minisign = pytest.mark.skipif(shutil.which("minisign") is None, reason="needs minisign")


def written(path: Path, text: str, mode: int = 0o644) -> Path:
    path.write_text(text)
    path.chmod(mode)
    return path


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    paths = tmp_path / "k.key", tmp_path / "k.pub"
    write_keys(SECRET, *paths)
    return paths


@pytest.fixture
def signature(tmp_path: Path) -> Path:
    return written(tmp_path / f"file{SUFFIX}", sign(b"content", SECRET, "said so"))


def test_the_authors_example_is_understood(tmp_path: Path) -> None:
    key = read_public_key(written(tmp_path / "author.pub", AUTHOR))
    assert key.name == "E7620F1842B4E81F"
    signed = written(tmp_path / "test.minisig", EXAMPLE)
    assert verify(b"test", signed, key) == "timestamp:1633700835\tfile:test\tprehashed"
    with pytest.raises(ConfigError, match="not over this file"):
        verify(b"Test", signed, key)


def test_what_was_signed_is_verified_with_its_comment(
    pair: tuple[Path, Path], signature: Path
) -> None:
    assert verify(b"content", signature, read_public_key(pair[1])) == "said so"
    assert read_secret_key(pair[0]) == SECRET


@given(st.integers(0, 73 + 64 + 6), st.integers(1, 255))
def test_no_byte_of_a_signature_or_its_comment_can_be_changed(at: int, change: int) -> None:
    import tempfile

    lines = sign(b"content", SECRET, "said so").splitlines()
    data, comment, whole = base64.b64decode(lines[1]), lines[2][17:], base64.b64decode(lines[3])
    flat = bytearray(data + whole + comment.encode())
    flat[at] ^= change
    changed = bytes(flat)
    lines[1], lines[3] = (base64.b64encode(p).decode() for p in (changed[:74], changed[74:138]))
    text = "\n".join((*lines[:2], "trusted comment: ")).encode() + changed[138:]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        path.write_bytes(text + b"\n" + lines[3].encode() + b"\n")
        with pytest.raises(ConfigError, match="file: "):
            verify(b"content", path, SECRET.public)


def test_a_signature_of_another_key_names_both(signature: Path) -> None:
    other = make_key().public
    with pytest.raises(
        ConfigError, match=f"with key {SECRET.public.name}, trusted is {other.name}"
    ):
        verify(b"content", signature, other)


def test_a_key_with_the_same_number_is_not_the_same_key(signature: Path) -> None:
    from dataclasses import replace

    imposter = replace(make_key().public, number=SECRET.number)
    with pytest.raises(ConfigError, match="not over this file"):
        verify(b"content", signature, imposter)


@pytest.mark.parametrize("text", ["", "one line\n", "a\nnot base64\n", "a\nAAAA\n", "\x00\n\x00\n"])
def test_what_is_no_file_of_minisigns_is_refused_by_name(tmp_path: Path, text: str) -> None:
    path = written(tmp_path / "odd", text, 0o600)
    for read in (read_public_key, read_secret_key, lambda p: verify(b"", p, SECRET.public)):
        with pytest.raises(ConfigError, match="odd: not a minisign"):
            read(path)
    path.write_bytes(b"\xff" * 5000)
    with pytest.raises(ConfigError, match="odd: not a file of minisign's"):
        read_public_key(path)
    with pytest.raises(ConfigError, match=r"none: No such file"):
        read_public_key(tmp_path / "none")


def test_a_signature_of_the_old_kind_is_refused(tmp_path: Path, signature: Path) -> None:
    """Over the content and not its hash: no minisign makes it any more unless it is asked to."""
    lines = signature.read_text().splitlines()
    data = b"Ed" + base64.b64decode(lines[1])[2:]
    lines[1] = base64.b64encode(data).decode()
    written(signature, "\n".join(lines))
    with pytest.raises(ConfigError, match="not a signature over a hash"):
        verify(b"content", signature, SECRET.public)


@pytest.mark.parametrize("mode", [0o664, 0o646, 0o666])
def test_a_public_key_that_others_may_change_is_not_trusted(
    pair: tuple[Path, Path], mode: int
) -> None:
    pair[1].chmod(mode)
    with pytest.raises(ConfigError, match=r"k\.pub: others may change this file .*chmod go-w"):
        read_public_key(pair[1])


@pytest.mark.parametrize("mode", [0o640, 0o604])
def test_a_secret_key_that_others_may_read_is_refused(pair: tuple[Path, Path], mode: int) -> None:
    assert pair[0].stat().st_mode & 0o777 == 0o600
    pair[0].chmod(mode)
    with pytest.raises(ConfigError, match=r"k\.key: others may use this key"):
        read_secret_key(pair[0])


def test_a_damaged_secret_key_is_refused(pair: tuple[Path, Path]) -> None:
    comment, line = pair[0].read_text().splitlines()
    data = bytearray(base64.b64decode(line))
    data[70] ^= 1
    written(pair[0], f"{comment}\n{base64.b64encode(bytes(data)).decode()}\n", 0o600)
    with pytest.raises(ConfigError, match="damaged"):
        read_secret_key(pair[0])


def test_keys_are_not_written_over_others(pair: tuple[Path, Path]) -> None:
    with pytest.raises(ConfigError, match=r"k\.key: File exists"):
        write_keys(make_key(), *pair)
    assert read_secret_key(pair[0]) == SECRET


def test_a_comment_cannot_hold_a_line_of_its_own() -> None:
    with pytest.raises(ConfigError, match="a comment is UTF-8"):
        sign(b"x", make_key(), "caf\udce9")
    with pytest.raises(ConfigError, match="one line"):
        sign(b"", SECRET, "said\nand more")


def run(*words: object, told: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["minisign", *map(str, words)], capture_output=True, text=True, check=False, input=told
    )


@minisign
def test_minisign_verifies_what_we_sign(pair: tuple[Path, Path], tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"content")
    written(tmp_path / f"file{SUFFIX}", sign(b"content", SECRET, "said so"))
    assert "said so" in run("-V", "-m", file, "-p", pair[1]).stdout
    file.write_bytes(b"other content")
    assert run("-V", "-m", file, "-p", pair[1]).returncode != 0


@minisign
def test_we_verify_what_minisign_signs_with_its_keys_and_with_ours(
    pair: tuple[Path, Path], tmp_path: Path
) -> None:
    file, its = tmp_path / "file", (tmp_path / "its.key", tmp_path / "its.pub")
    file.write_bytes(b"content")
    assert run("-G", "-W", "-p", its[1], "-s", its[0]).returncode == 0
    its[1].chmod(0o644)
    for secret, public in (its, pair):
        assert run("-S", "-s", secret, "-m", file, "-t", "its words").returncode == 0
        key = read_public_key(public)
        assert read_secret_key(secret).public == key
        assert verify(b"content", tmp_path / f"file{SUFFIX}", key) == "its words"


@minisign
def test_a_key_with_a_password_is_left_to_minisign(tmp_path: Path) -> None:
    key = tmp_path / "its.key"
    made = run("-G", "-p", tmp_path / "its.pub", "-s", key, told="secret\nsecret\n")
    if made.returncode:
        pytest.skip("this minisign asks a terminal for passwords")
    with pytest.raises(ConfigError, match="has a password: sign with minisign -S"):
        read_secret_key(key)
