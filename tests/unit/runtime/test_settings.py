from pathlib import Path

import pytest

from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.settings import CONFIG_DIR, Count, Positive, Settings, convert, load, shipped


class Inner(Settings, frozen=True):
    gain: Positive = 1.0


class Outer(Settings, frozen=True):
    inner: Inner = Inner()
    count: Count = 3
    names: tuple[str, ...] = ()


def test_defaults_need_no_file() -> None:
    assert convert({}, Outer) == Outer()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"inner": {"gain": -1}}, ["boat.toml", "inner.gain", "-1", "> 0"]),
        ({"inner": {"gian": 1}}, ["boat.toml", "inner.gian", "unknown", "gain"]),
        ({"count": "three"}, ["boat.toml", "count", "three", "int"]),
        ({"colour": 1}, ["boat.toml", "colour", "unknown", "inner, count, names"]),
        ({"names": ["a", 2]}, ["boat.toml", "names[1]", "str"]),
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
