"""Writes settings as a TOML file that explains itself: each key with its default and docstring.

config/runtime.toml is made by ``python -m twinscrew.runtime.cli.reference``, config/envelope.toml
by the same with ``envelope`` behind it; a test compares.
"""

from __future__ import annotations

import ast
import inspect
import sys
import textwrap
from collections.abc import Collection, Iterator
from contextlib import suppress
from enum import Enum
from itertools import pairwise
from typing import Any, get_args

import msgspec

from twinscrew.runtime.safety.envelope import EnvelopeSettings
from twinscrew.runtime.settings import Settings
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel.hull_settings import hull_settings
from twinscrew.runtime.vessel_description import load_vessel

WIDTH = 100
HEAD = """\
# Every setting of a vessel's runtime, with its default. A file needs only the keys that differ.
# Frames: N is north-east-down, B forward-starboard-down. `twinscrew run --config FILE` uses it,
# `twinscrew doctor --config FILE` checks it. Made from the source; do not edit by hand.
# A key that is commented out and has a value follows `vessel`; the value is the default vessel's.
"""


def as_toml(
    settings: Settings,
    path: tuple[str, ...] = (),
    follows: Collection[tuple[str, ...]] = (),
) -> Iterator[str]:
    """Give the lines of a TOML file with the settings' values and their docstrings as comments.

    Keys that follow something else are commented out.
    """
    meanings = _docstrings(type(settings))
    groups: list[tuple[str, Settings]] = []
    absent: list[tuple[str, Settings]] = []
    for field in msgspec.structs.fields(settings):
        value = getattr(settings, field.name)
        if isinstance(value, Settings):
            groups.append((field.encode_name, value))
            continue
        default = _optional_group(field.type) if value is None else None
        if default is not None:
            absent.append((field.encode_name, default))
            continue
        yield from _comment(meanings.get(field.name, ""))
        if value is None:
            yield f"# {field.encode_name} ="
        elif (*path, field.encode_name) in follows:
            yield f"# {field.encode_name} = {_literal(value)}"
        else:
            yield f"{field.encode_name} = {_literal(value)}"
    for name, group in groups:
        yield ""
        yield f"[{'.'.join((*path, name))}]"
        own = meanings.get(name, "")
        yield from _comment(own or inspect.cleandoc(type(group).__doc__ or "").splitlines()[0])
        yield from as_toml(group, (*path, name), follows)
    for name, group in absent:
        yield ""
        yield f"# [{'.'.join((*path, name))}]"
        yield from _comment(inspect.cleandoc(type(group).__doc__ or "").splitlines()[0])
        for line in as_toml(group, (*path, name)):
            yield line if line.startswith("#") else f"# {line}"


def _optional_group(type_: Any) -> Settings | None:
    """Give the defaults of a table that is not there unless it is written; None: it has none."""
    for part in get_args(type_):
        if isinstance(part, type) and issubclass(part, Settings):
            with suppress(TypeError):  # of keys without a default
                return part()
    return None


def _docstrings(type_: type[Settings]) -> dict[str, str]:
    """Find the docstring under each field, inherited ones too."""
    lineage = [t for t in reversed(type_.__mro__) if issubclass(t, Settings) and t is not Settings]
    return {name: text for one in lineage for name, text in _own_docstrings(one).items()}


def _own_docstrings(type_: type[Settings]) -> dict[str, str]:
    """Find the docstring under each field; the interpreter does not keep them."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(type_)))
    (body,) = (node.body for node in tree.body if isinstance(node, ast.ClassDef))
    found = {}
    for field, text in pairwise(body):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(text, ast.Expr)
            and isinstance(text.value, ast.Constant)
        ):
            found[field.target.id] = " ".join(str(text.value.value).split())
    return found


def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(text, WIDTH - 2)]


def _literal(value: Any) -> str:
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_literal(item) for item in value)}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {_literal(item)}' for key, item in value.items())}}}"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)


def reference() -> str:
    """Give the whole of config/runtime.toml."""
    hull = hull_settings(load_vessel("otter"))
    del hull["estimation"]  # a sensor's place is given as a whole
    follows = set(_paths(hull))
    return HEAD + "\n" + "\n".join(as_toml(RuntimeConfig(), follows=follows)) + "\n"


ENVELOPE_HEAD = """\
# The operational envelope: what the boat was proved for, and what it does beyond it (docs/odd.md).
# These are the defaults: the worst of 12 voyages in the rough sea (config/sea/rough.toml) and a
# margin. Copy it, write in it what your boat was proved for, and name the copy in the boat's file:
# envelope = "envelope.toml". Made from the source; do not edit by hand.
"""


def envelope_reference() -> str:
    """Give the whole of config/envelope.toml."""
    return ENVELOPE_HEAD + "\n" + "\n".join(as_toml(EnvelopeSettings())) + "\n"


def _paths(tree: dict[str, Any], path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Give the dotted keys of a tree of tables."""
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _paths(value, (*path, key))
        else:
            yield (*path, key)


if __name__ == "__main__":
    print(envelope_reference() if sys.argv[1:] == ["envelope"] else reference(), end="")
