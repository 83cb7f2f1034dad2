"""Settings: frozen, typed, validated, complete without any file.

A stage's settings stand directly above the stage, as a `Settings` struct. Ranges are written in
the type (`Annotated[float, Meta(gt=0)]`), so that one place checks them: an unknown key, a wrong
type or a value out of range is a `ConfigError` that names file, key, value and what is allowed.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, TypeVar, Union, get_args, get_origin

import msgspec
from msgspec import Meta

from twinscrew.runtime.errors import NOT_THE_FORMAT, ConfigError, one_of
from twinscrew.runtime.files import read_file

Positive = Annotated[float, Meta(gt=0.0)]
NonNegative = Annotated[float, Meta(ge=0.0)]
Fraction = Annotated[float, Meta(ge=0.0, le=1.0)]
Count = Annotated[int, Meta(ge=1, le=2**31 - 1)]
MOST_BYTES = 16_000_000
"""[B] Of a file of settings: more is none, and /dev/zero never ends."""

CONFIG_DIR = Path(__file__).resolve().parent.parent / "config"
"""Where the shipped configuration lies: beside this package, in a checkout and in a wheel."""


class Settings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A group of settings: frozen, by keyword, refusing unknown keys and what is not finite."""

    finite: ClassVar[bool] = True
    """False where nan is a value that a file may hold."""


S = TypeVar("S", bound=Settings)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; a `ConfigError` says where it cannot be read."""
    try:
        content = read_file(path, MOST_BYTES)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error
    return _toml(content, path)


def parse(content: bytes, type_: type[S], *, file: Path) -> S:
    """Read settings from a TOML file's content."""
    return convert(_toml(content, file), type_, file=file)


def load(path: Path, type_: type[S]) -> S:
    """Read settings from a TOML file."""
    return convert(read_toml(path), type_, file=path)


def convert(values: object, type_: type[S], *, file: Path | str | None = None) -> S:
    """Turn plain values into settings; `file` is named in the error."""
    for where, words in _unusable(values, finite=type_.finite):
        raise ConfigError(words, file=file, key=where)
    try:
        return msgspec.convert(values, type_)
    except msgspec.ValidationError as error:
        key, message = _explain(str(error), values, type_)
        raise ConfigError(message, file=file, key=key) from error


def shipped(folder: str, name: str | Path, suffix: str = ".toml") -> Path:
    """Find a configuration file: a path as it is, or a name in the shipped `folder`."""
    path = Path(name)
    if path.suffix or path.parent != Path():
        if not path.is_file():
            raise ConfigError("no such file", file=path)
        return path
    found = CONFIG_DIR / folder / f"{name}{suffix}"
    if not found.is_file():
        names = sorted(p.stem for p in (CONFIG_DIR / folder).glob(f"*{suffix}"))
        raise ConfigError(one_of(str(name), names), file=CONFIG_DIR / folder)
    return found


def _toml(content: bytes, file: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(content.decode("utf-8-sig"))  # some editors begin files with a mark
    except NOT_THE_FORMAT as error:
        raise ConfigError(f"not TOML: {error}", file=file) from error


def _unusable(values: object, *, finite: bool) -> Iterator[tuple[str, str]]:
    """Give the keys of what no type refuses: NaN and infinities, and text that no path can hold."""
    pending = [("", values)]  # a dotted key may nest deeper than functions can
    while pending:
        key, value = pending.pop()
        if finite and isinstance(value, float) and not math.isfinite(value):
            yield key, f"expected a finite number, got {value}"
        elif isinstance(value, str) and "\0" in value:
            yield key, f"expected text without zero bytes, got {value!r}"
        elif isinstance(value, Mapping):
            pending += [(f"{key}.{name}" if key else str(name), v) for name, v in value.items()]
        elif isinstance(value, list | tuple):
            pending += [(f"{key}[{place}]", v) for place, v in enumerate(value)]


def _explain(message: str, values: object, type_: type[Settings]) -> tuple[str | None, str]:
    """Give the key and a message with the refused value, from msgspec's words."""
    match = re.match(r"(?P<what>.*?)(?: - at `\$\.?(?P<key>[^`]*)`)?$", message)
    what, key = (match["what"], match["key"]) if match else (message, None)
    unknown = re.match(r"Object contains unknown field `(?P<field>[^`]*)`", what)
    if unknown:
        allowed = _fields(_type_at(type_, key))
        full = f"{key}.{unknown['field']}" if key else unknown["field"]
        return full, "unknown key" + (f"; allowed: {', '.join(allowed)}" if allowed else "")
    value, expected = _value_at(values, key), _type_at(type_, key)
    if get_origin(expected) is Literal and value is not None:
        return key, one_of(value, get_args(expected))
    return key or None, what + (f", got {value!r}" if value is not None else "")


def _value_at(values: object, key: str | None) -> object:
    for part in re.findall(r"[^.\[\]]+", key or ""):
        if isinstance(values, dict):
            values = values.get(part)
        elif isinstance(values, list) and part.isdigit() and int(part) < len(values):
            values = values[int(part)]
        else:
            return None
    return None if isinstance(values, dict) else values


def _type_at(type_: Any, key: str | None) -> Any:
    """Give the type of a key's value, without None; None if that is not to be found."""
    for part in re.findall(r"[^.\[\]]+", key or ""):
        if _fields(type_):
            type_ = {f.encode_name: f.type for f in msgspec.structs.fields(type_)}.get(part)
        else:
            type_ = next(iter(get_args(type_)), None)  # of a list's elements
        type_ = _without_none(type_)
    return type_


def _without_none(type_: Any) -> Any:
    if get_origin(type_) is Annotated:
        type_ = get_args(type_)[0]
    parts = [part for part in get_args(type_) if part is not NoneType]
    return parts[0] if get_origin(type_) in (Union, UnionType) and len(parts) == 1 else type_


def _fields(type_: Any) -> list[str]:
    if not (isinstance(type_, type) and issubclass(type_, msgspec.Struct)):
        return []
    return [f.encode_name for f in msgspec.structs.fields(type_)]
