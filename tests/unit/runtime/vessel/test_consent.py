"""Consent to arm: given once, used once, and worth nothing when it is old."""

from pathlib import Path

import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.vessel import consent


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return consent.place_of(tmp_path / "wamv.toml", "")


def test_it_counts_once(place: Path) -> None:
    consent.give(place)
    assert consent.take(place) is None
    assert "nobody has given consent" in (consent.take(place) or "")


def test_given_twice_it_still_counts_once(place: Path) -> None:
    consent.give(place)
    consent.give(place)
    assert consent.take(place) is None
    assert consent.take(place) is not None


def test_after_ten_minutes_it_is_none_and_is_used_up_all_the_same(place, monkeypatch) -> None:
    consent.give(place)
    later_s = consent._uptime_s() + consent.LASTS_S + 1.0
    monkeypatch.setattr(consent, "_uptime_s", lambda: later_s)
    assert "601 s old" in (consent.take(place) or "")
    assert not place.exists()


def test_after_a_restart_of_the_computer_it_is_none(place, monkeypatch) -> None:
    consent.give(place)
    monkeypatch.setattr(consent, "_boot", lambda: "another")
    assert "before the computer was restarted" in (consent.take(place) or "")


@pytest.mark.parametrize(
    "content", [b"", b"yes", b"\xff" * 100_000, b"twinscrew: consent to arm\nx\nnan\n"]
)
def test_anything_else_is_none(place: Path, content: bytes) -> None:
    place.write_bytes(content)
    assert consent.take(place) is not None


def test_what_cannot_be_used_up_is_none(place: Path, monkeypatch) -> None:
    consent.give(place)

    def refuse(_path: Path) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "unlink", refuse)
    assert "cannot be used up" in (consent.take(place) or "")


def test_where_it_cannot_be_written_that_is_said(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        consent.give(tmp_path / "nowhere" / "wamv.arm")


def test_it_lies_beside_the_configuration_or_where_that_says(tmp_path: Path) -> None:
    assert consent.place_of(tmp_path / "a.toml", "") == tmp_path / "a.toml.arm"
    assert consent.place_of(tmp_path / "a.toml", "/run/twinscrew/a.arm") == Path(
        "/run/twinscrew/a.arm"
    )
