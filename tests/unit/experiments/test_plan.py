from pathlib import Path

import pytest

from twinscrew.hil_sim.experiments.plan import (
    Experiment,
    Method,
    SetSettings,
    check,
    episode_seed,
    parse_methods,
    tasks,
)
from twinscrew.hil_sim.experiments.runner import count, key_of
from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.runtime.settings import CONFIG_DIR

SETS = (SetSettings(name="one", vessels=2), SetSettings(name="two", vessels=3))
METHODS = tuple(Method(name=name, policy=name, sha256="0") for name in ("apf", "mpc"))


def plan(**changes) -> Experiment:
    return Experiment(**{"methods": METHODS, "sets": SETS, "episodes": 3, "seed": 5, **changes})


def test_every_episode_of_every_method_set_and_variant_is_there_once() -> None:
    experiment = plan(variants=((), ("no_wind",)))
    keys = [key_of(task) for task in tasks(experiment)]
    assert len(keys) == len(set(keys)) == count(experiment) == 2 * 2 * 3 * 2


def test_the_first_episodes_of_all_come_before_the_second_of_any() -> None:
    assert [task.episode for task in tasks(plan())] == [0] * 4 + [1] * 4 + [2] * 4


def test_methods_and_variants_sail_the_same_episodes() -> None:
    seeds: dict[tuple[str, int], set[int]] = {}
    for task in tasks(plan(variants=((), ("no_wind",)))):
        seeds.setdefault((task.set.name, task.episode), set()).add(task.seed)
    assert all(len(several) == 1 for several in seeds.values())
    assert len(set.union(*seeds.values())) == 6


def test_an_episodes_seed_does_not_depend_on_what_else_is_sailed() -> None:
    alone = {key_of(task): task.seed for task in tasks(plan(sets=SETS[1:], episodes=2))}
    whole = {key_of(task): task.seed for task in tasks(plan())}
    assert alone.items() <= whole.items()


def test_another_seed_gives_other_episodes() -> None:
    assert episode_seed(1, "one", 0) != episode_seed(2, "one", 0)


def test_seeds_stay_what_they_were() -> None:
    assert episode_seed(3, "5 rob 0 obs", 0) == 3585244792


def test_methods_are_names_or_names_with_files() -> None:
    shipped = CONFIG_DIR / "policies" / "ac_iqn.onnx"
    apf, mine, bare = parse_methods(f"apf, mine={shipped}, {shipped}")
    assert (apf.name, apf.policy) == ("apf", "apf")
    assert (mine.name, bare.name) == ("mine", "ac_iqn")
    assert mine.sha256 == bare.sha256 != apf.sha256


@pytest.mark.parametrize("text", ["", " , ", "apf,apf"])
def test_no_method_and_a_method_twice_are_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="--methods: name each method once"):
        parse_methods(text)


@pytest.mark.parametrize("text", ["no_such", "mine=no/such.onnx"])
def test_a_method_without_a_policy_is_named(text: str) -> None:
    name = text.partition("=")[0]
    with pytest.raises(PolicyError, match=f"method '{name}' has no policy.*{name}=FILE.onnx"):
        parse_methods(f"apf,{text}")


def test_chance_is_a_method_without_a_file() -> None:
    (method,) = parse_methods("random")
    check(method)
    assert (method.policy, len(method.sha256)) == ("random", 64)


def test_a_file_that_is_no_policy_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bad.onnx").write_bytes(b"nonsense")
    with pytest.raises(PolicyError, match="method 'bad' has no policy"):
        parse_methods(str(tmp_path / "bad.onnx"))


def test_a_policy_that_has_changed_is_refused() -> None:
    (method,) = parse_methods("apf")
    check(method)
    with pytest.raises(PolicyError, match="has changed since"):
        check(METHODS[0])
