import tomllib

from twinscrew.runtime.cli.reference import as_toml, envelope_reference, reference
from twinscrew.runtime.settings import CONFIG_DIR, Settings
from twinscrew.runtime.vessel.config import RuntimeConfig, load_config


class Inner(Settings, frozen=True):
    """What is inside."""

    names: tuple[str, ...] = ('a "quoted" \\ word', "b")
    """Two words."""
    flag: bool = True


class Outer(Settings, frozen=True):
    """What is outside."""

    inner: Inner = Inner()
    missing: float | None = None
    """[m] Nothing by default."""
    size_m: float = 1e-3


def test_the_shipped_file_is_made_of_the_source() -> None:
    shipped = (CONFIG_DIR / "runtime.toml").read_text()
    hint = "run: python -m twinscrew.runtime.cli.reference > config/runtime.toml"
    assert shipped == reference(), hint


def test_the_shipped_envelope_is_made_of_the_source_and_says_the_defaults(tmp_path) -> None:
    shipped = CONFIG_DIR / "envelope.toml"
    hint = "run: python -m twinscrew.runtime.cli.reference envelope > config/envelope.toml"
    assert shipped.read_text() == envelope_reference(), hint
    (tmp_path / "boat.toml").write_text('envelope = "envelope"\n')
    assert load_config(tmp_path / "boat.toml") == RuntimeConfig()


def test_the_shipped_file_says_the_defaults() -> None:
    assert load_config(CONFIG_DIR / "runtime.toml") == RuntimeConfig()


def test_every_value_comes_back_from_the_file_and_bears_its_meaning() -> None:
    lines = list(as_toml(Outer()))
    assert lines == [
        "# [m] Nothing by default.",
        "# missing =",
        "size_m = 0.001",
        "",
        "[inner]",
        "# What is inside.",
        "# Two words.",
        'names = ["a \\"quoted\\" \\\\ word", "b"]',
        "flag = true",
    ]
    assert tomllib.loads("\n".join(lines))["inner"]["names"] == list(Inner().names)


def test_every_key_of_the_shipped_file_is_explained() -> None:
    lines = reference().splitlines()
    keys = [k for k, line in enumerate(lines) if " = " in line and not line.startswith("#")]
    bare = [lines[k] for k in keys if not lines[k - 1].startswith("#")]
    assert bare == []
