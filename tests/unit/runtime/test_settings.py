import math
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import pytest
from msgspec import Meta

from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.settings import CONFIG_DIR, Count, Positive, Settings, convert, load, shipped


class Inner(Settings, frozen=True):
    gain: Positive = 1.0
    offset: float = 0.0


class Outer(Settings, frozen=True):
    inner: Inner = Inner()
    count: Count = 3
    names: tuple[str, ...] = ()
    places: tuple[tuple[float, float], ...] = ()
    kind: Literal["a", "b"] = "a"
    maybe: Inner | None = None
    several: Annotated[tuple[Inner, ...], Meta(max_length=9)] = ()


def test_defaults_need_no_file() -> None:
    assert convert({}, Outer) == Outer()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"inner": {"gain": -1}}, ["boat.toml", "inner.gain", "-1", "> 0"]),
        ({"inner": {"gian": 1}}, ["boat.toml", "inner.gian", "unknown", "gain"]),
        ({"count": "three"}, ["boat.toml", "count", "three", "int"]),
        ({"count": 2**31}, ["boat.toml", "count", "<= 2147483647"]),
        ({"names": ["a", "b\0c"]}, ["boat.toml", "names[1]", "without zero bytes"]),
        ({"colour": 1}, ["boat.toml", "colour", "unknown", "inner, count, names, places, kind"]),
        ({"names": ["a", 2]}, ["boat.toml", "names[1]", "str"]),
        ({"kind": "c"}, ["boat.toml: kind: 'c' is not one of 'a', 'b'"]),
        ({"kind": 3}, ["boat.toml: kind: 3 is not one of 'a', 'b'"]),
        ({"maybe": {"gian": 1}}, ["boat.toml: maybe.gian: unknown key; allowed: gain, offset"]),
        ({"several": [{}, {"x": 1}]}, ["boat.toml: several[1].x: unknown key; allowed: gain"]),
        ({"several": [{"gain": 0}]}, ["boat.toml: several[0].gain", "> 0", "got 0"]),
    ],
)
def test_a_refusal_names_file_key_value_and_what_is_allowed(
    values: dict[str, object], words: list[str]
) -> None:
    with pytest.raises(ConfigError) as refused:
        convert(values, Outer, file="boat.toml")
    for word in words:
        assert word in str(refused.value)


def test_a_file_that_is_missing_or_no_toml_is_named(tmp_path: Path) -> None:
    missing = tmp_path / "none.toml"
    with pytest.raises(ConfigError, match=r"none\.toml"):
        load(missing, Outer)
    broken = tmp_path / "broken.toml"
    broken.write_text("count = = 3")
    with pytest.raises(ConfigError, match="not TOML"):
        load(broken, Outer)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="not TOML"):
        load(binary, Outer)


@pytest.mark.parametrize(
    "content",
    [b"a = " + b"[" * 5000 + b"]" * 5000, b"count = " + b"9" * 5000],
    ids=["nested too deep", "too many digits"],
)
def test_what_the_parser_itself_cannot_bear_is_refused_by_name(
    tmp_path: Path, content: bytes
) -> None:
    file = tmp_path / "hostile.toml"
    file.write_bytes(content)
    with pytest.raises(ConfigError, match=r"hostile\.toml: not TOML"):
        load(file, Outer)


def test_a_key_that_is_nested_too_deep_is_an_unknown_key() -> None:
    values: dict[str, object] = {}
    for _ in range(5000):
        values = {"a": values}
    with pytest.raises(ConfigError, match="a: unknown key"):
        convert(values, Outer)


def test_a_file_may_begin_with_the_mark_that_some_editors_write(tmp_path: Path) -> None:
    file = tmp_path / "marked.toml"
    file.write_bytes(b"\xef\xbb\xbfcount = 5\r\n")
    assert load(file, Outer).count == 5


@pytest.mark.parametrize("typed", ["nan", "inf", "-inf", "1e400"])
@pytest.mark.parametrize(
    ("content", "key"),
    [
        ("[inner]\ngain = {}", "inner.gain"),
        ("[inner]\noffset = {}", "inner.offset"),
        ("places = [[0.0, 1.0], [2.0, {}]]", "places[1][1]"),
    ],
)
def test_a_number_that_is_not_finite_is_no_setting(
    tmp_path: Path, content: str, key: str, typed: str
) -> None:
    file = tmp_path / "boat.toml"
    file.write_text(content.format(typed))
    with pytest.raises(ConfigError) as refused:
        load(file, Outer)
    assert str(refused.value).startswith(f"{file}: {key}: expected a finite number, got ")


def test_nan_is_a_value_where_the_settings_say_so() -> None:
    class Measured(Settings, frozen=True):
        finite: ClassVar[bool] = False
        times: tuple[float, ...]

    assert math.isnan(convert({"times": [1.0, math.nan]}, Measured).times[1])


def test_shipped_files_are_found_by_name_and_others_by_path(tmp_path: Path) -> None:
    assert shipped("sensors", "vrx32") == CONFIG_DIR / "sensors" / "vrx32.toml"
    own = tmp_path / "own.toml"
    own.touch()
    assert shipped("sensors", own) == own
    with pytest.raises(ConfigError, match="vrx16"):
        shipped("sensors", "vrx3")
    with pytest.raises(ConfigError, match="no such file"):
        shipped("sensors", tmp_path / "other.toml")


def test_every_choice_is_listed() -> None:
    assert one_of("c", ["a", "b"]) == "'c' is not one of 'a', 'b'"
