import pytest
from msgspec.structs import replace
from tests.unit.experiments.episodes import episode, vessel

from twinscrew.hil_sim.experiments.plan import Experiment, parse_methods, tasks
from twinscrew.hil_sim.experiments.results import EpisodeRecord
from twinscrew.hil_sim.experiments.suites import SUITES, arrivals, counted, find_suite
from twinscrew.hil_sim.report.tables import suite as suite_tables
from twinscrew.runtime.errors import ConfigError

ASHORE = (vessel("collision", 8.0, "quay"), vessel())
FENCED = (vessel("fence", 9.0, "fence"), vessel(), vessel("timeout", 180.0))
SHIP = (vessel("collision", 8.0, "traffic"), vessel("collision", 8.0, "vessel"))


def mixed() -> list[EpisodeRecord]:
    return [
        episode(0, kind="basin"),
        episode(1, vessels=ASHORE, cause="quay", kind="basin"),
        episode(2, vessels=FENCED, cause="fence", kind="gap"),
        episode(3, vessels=SHIP, cause="vessel", kind="gap"),
    ]


def test_vessels_contacts_and_fences_are_counted_by_what_was_touched() -> None:
    figures = arrivals(mixed())
    assert (figures["vessels"], figures["arrived"], figures["out_of_time"]) == (9, 4, 1)
    assert figures["arrived_rate"] == round(4 / 9, 4)
    assert figures["contacts"] == 3
    assert figures["contacts_with"] == {"vessel": 2, "buoy": 0, "quay": 1}
    assert figures["fence_entries"] == 1
    assert figures["by_kind"]["basin"]["arrived_rate"] == 0.75
    assert figures["by_kind"]["gap"]["contacts"] == 2


def test_aims_are_told_as_reached_or_missed_for_their_sets_alone() -> None:
    good = [replace(episode(k), set="0.3 of the top speed") for k in range(4)]
    bad = [replace(one, set="0.5 of the top speed") for one in mixed()]
    first, second = counted("currents", good + bad)
    assert first.aims == {"arrived_rate at least 0.995": True, "contacts at most 0": True}
    assert second.aims == {"arrived_rate at least 0.98": False, "contacts at most 0": False}
    (nobody,) = counted("gap", [episode(0, vessels=(vessel("timeout"),), cause="time")])
    assert nobody.aims["travel_time_p95_s at most 14"] is False


def test_a_report_shows_figures_tables_and_aims() -> None:
    figures, *rest = suite_tables(list(counted("harbours", mixed())))
    assert "| contacts | 3 |" in figures
    assert any("| basin | 4 | 0.75 |" in part for part in rest)
    assert "| a, one | contacts at most 0 | no |" in rest[-1]


@pytest.mark.parametrize("name", SUITES)
def test_every_suite_draws_its_episodes_afresh(name: str) -> None:
    suite = find_suite(name)
    experiment = Experiment(methods=parse_methods("apf"), sets=suite.sets, episodes=2, suite=name)
    drawn = [task.set.draw(task.seed) for task in tasks(experiment)]
    assert len(drawn) == 2 * len(suite.sets)
    if drawn[0].kind:
        assert drawn[0].starts.tolist() != drawn[len(suite.sets)].starts.tolist()


def test_an_unknown_suite_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(ConfigError, match="harbours"):
        find_suite("harbors")
