"""Keeps `[m/s] [N]` in docstrings what it is, unit and frame: Markdown would read it as a link."""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension, Object

PAIR = re.compile(r"(?<=\])\s+(?=\[)")


class Brackets(Extension):
    """Escapes the second of two brackets."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Do so in an object's docstring, before it is read."""
        if obj.docstring is not None:
            obj.docstring.value = PAIR.sub(r" \\", obj.docstring.value)
