"""Signatures in minisign's format: small files that its tool, and others, make and check as well.

Source: https://jedisct1.github.io/minisign/ ("Signature format", "Public key format", "Secret key
format"). Ed25519 comes from the `cryptography` package, BLAKE2b from Python's library; only the
files' layout is ours. Secret keys with a password are for minisign's own tool.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.files import require_private, require_unwritable

SUFFIX: Final = ".minisig"
"""A file's signature lies beside it under its name and this."""
UNTRUSTED: Final = "untrusted comment: "
TRUSTED: Final = "trusted comment: "
_KEY: Final = b"Ed"
_HASHED: Final = b"ED"
"""The signature is over the content's BLAKE2b-512, as minisign does since version 0.10."""
_NO_PASSWORD: Final = bytes(2)
_CHECKED: Final = b"B2"
_LONGEST: Final = 4096
"""[bytes] No key or signature is longer: nothing else is read."""


@dataclass(frozen=True, slots=True)
class PublicKey:
    """What signatures are checked with."""

    number: bytes
    """8 bytes that tell keys apart; no secret, no proof."""
    key: bytes
    """32 bytes."""

    @property
    def name(self) -> str:
        """The number as minisign writes it."""
        return self.number[::-1].hex().upper()


@dataclass(frozen=True, slots=True)
class SecretKey:
    """What signatures are made with."""

    number: bytes
    seed: bytes
    """32 bytes."""

    @property
    def public(self) -> PublicKey:
        """The key that checks what this one signs."""
        key = Ed25519PrivateKey.from_private_bytes(self.seed).public_key()
        return PublicKey(self.number, key.public_bytes_raw())


def make_key() -> SecretKey:
    """Make a new key from the system's randomness."""
    return SecretKey(os.urandom(8), Ed25519PrivateKey.generate().private_bytes_raw())


def read_public_key(path: Path) -> PublicKey:
    """Read a public key.

    Raises
    ------
    ConfigError
        It cannot be read, others than its owner may change it, or it is none.
    """
    require_unwritable(path)
    data = _payload(path, _lines(path)[1:2], 42, "public key")
    if data[:2] != _KEY:
        raise ConfigError("not a minisign public key", file=path)
    return PublicKey(data[2:10], data[10:])


def read_secret_key(path: Path) -> SecretKey:
    """Read a secret key.

    Raises
    ------
    ConfigError
        It cannot be read, others than its owner may use it, it is none, or it has a password.
    """
    require_private(path)
    data = _payload(path, _lines(path)[1:2], 158, "secret key")
    if data[:2] != _KEY or data[4:6] != _CHECKED:
        raise ConfigError("not a minisign secret key", file=path)
    if data[2:4] != _NO_PASSWORD:
        raise ConfigError("has a password: sign with minisign -S", file=path)
    number, seed, public, check = data[54:62], data[62:94], data[94:126], data[126:]
    secret = SecretKey(number, seed)
    unchecked = bytes(32)  # minisign leaves the sum out where there is no password
    if check not in (_check(number, seed + public), unchecked) or secret.public.key != public:
        raise ConfigError("damaged: its parts do not belong together", file=path)
    return secret


def write_keys(secret: SecretKey, secret_path: Path, public_path: Path) -> None:
    """Write a pair of keys, as `minisign -G -W` does; existing files are left alone.

    Raises
    ------
    ConfigError
        A file exists, or cannot be written.
    """
    public = secret.public
    head = _KEY + _NO_PASSWORD + _CHECKED + bytes(48)
    body = secret.seed + public.key
    kept = head + secret.number + body + _check(secret.number, body)
    told = _KEY + public.number + public.key
    _create(secret_path, _text(f"twinscrew secret key {public.name}", kept), 0o600)
    _create(public_path, _text(f"minisign public key {public.name}", told), 0o644)


def sign(content: bytes, secret: SecretKey, comment: str) -> str:
    """Give the text of a signature file; `comment` is signed, too."""
    if comment.splitlines() not in ([], [comment]):
        raise ConfigError("a comment has one line")
    try:
        comment.encode()
    except UnicodeEncodeError:
        raise ConfigError(f"a comment is UTF-8: {comment!r} is not", key="--comment") from None
    private = Ed25519PrivateKey.from_private_bytes(secret.seed)
    signature = private.sign(_digest(content))
    whole = private.sign(signature + comment.encode())
    head = _text(
        f"signature by twinscrew, key {secret.public.name}", _HASHED + secret.number + signature
    )
    return f"{head}{TRUSTED}{comment}\n{base64.b64encode(whole).decode()}\n"


def verify(content: bytes, signature: Path, key: PublicKey) -> str:
    """Check a signature over content, and give its trusted comment.

    Raises
    ------
    ConfigError
        There is no signature, it is of another key, or it is not over this content.
    """
    lines = _lines(signature)
    data = _payload(signature, lines[1:2], 74, "signature")
    if data[:2] != _HASHED:
        raise ConfigError("not a signature over a hash, as minisign makes", file=signature)
    if data[2:10] != key.number:
        other = PublicKey(data[2:10], b"").name
        raise ConfigError(f"made with key {other}, trusted is {key.name}", file=signature)
    comment = lines[2].removeprefix(TRUSTED) if len(lines) > 2 else ""
    whole = _payload(signature, lines[3:4], 64, "signature of the comment")
    public = Ed25519PublicKey.from_public_bytes(key.key)
    try:
        public.verify(data[10:], _digest(content))
        public.verify(whole, data[10:] + comment.encode())
    except InvalidSignature:
        raise ConfigError("the signature is not over this file", file=signature) from None
    return comment


def _digest(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=64).digest()


def _check(number: bytes, key: bytes) -> bytes:
    return hashlib.blake2b(_KEY + number + key, digest_size=32).digest()


def _text(comment: str, payload: bytes) -> str:
    return f"{UNTRUSTED}{comment}\n{base64.b64encode(payload).decode()}\n"


def _lines(path: Path) -> list[str]:
    try:
        with path.open("rb") as file:
            return file.read(_LONGEST).decode("utf-8").splitlines()
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error
    except UnicodeDecodeError as error:
        raise ConfigError("not a file of minisign's", file=path) from error


def _payload(path: Path, line: list[str], size: int, what: str) -> bytes:
    try:
        data = base64.b64decode(line[0] if line else "", validate=True)
    except binascii.Error:
        data = b""
    if len(data) != size:
        raise ConfigError(f"not a minisign {what}", file=path)
    return data


def _create(path: Path, text: str, mode: int) -> None:
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error
