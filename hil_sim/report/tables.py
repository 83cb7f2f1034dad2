"""The report's tables: each a function from the material to Markdown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import Any

from twinscrew.hil_sim.experiments.plan import FULL
from twinscrew.hil_sim.experiments.results import CAUSES, Cause
from twinscrew.hil_sim.experiments.suites import Counted
from twinscrew.hil_sim.experiments.summary import Cell, Paired, Rule, bootstrap_mean, holm, pair
from twinscrew.hil_sim.report.markdown import NOTHING, interval, number, p_value, share, table
from twinscrew.hil_sim.report.material import Material

HEADERS: dict[Cause, str] = {
    "vessel": "hit a vessel",
    "buoy": "hit a buoy",
    "quay": "hit a quay",
    "fence": "entered a fence",
    "time": "over time",
}
"""What the columns of causes are called."""
UNASSURED = "no_assurance"
"""The variant in which the policy's thrust goes to the propellers unchecked."""


def success(material: Material) -> str:
    """Success rates, a row a method, a column a set."""
    rows = [
        [method, *(_success(material.full(method, one)) for one in material.sets)]
        for method in material.methods
    ]
    return table(["", *material.sets], rows)


def failures(material: Material) -> str:
    """First failures by cause over all sets."""
    rows = []
    for method in material.methods:
        cell = material.pooled.get((method, material.main))
        if cell is not None:
            rows.append([method, _success(cell), *(str(cell.failures[c]) for c in CAUSES)])
    return table(["", "success", *HEADERS.values()], rows)


def travel_time(material: Material) -> str:
    """Travel times with their intervals, beside the paper's."""
    rows = []
    for method in material.methods:
        cells = [material.full(method, one) for one in material.sets]
        rows.append([method, *(_time(cell) for cell in cells)])
        published = [material.published.get((method, one), math.nan) for one in material.sets]
        if any((method, one) in material.published for one in material.sets):
            rows.append([f"{method}, paper", *(number(value) for value in published)])
    return table(["[s]", *material.sets], rows)


def paired(material: Material) -> str:
    """Compare the first method with every other, on the episodes that both have sailed."""
    first, *others = material.methods
    pairs = {other: compare(material, first, other) for other in others}
    adjusted = holm([one.p_value for one in pairs.values()])
    rows = [
        [
            f"{first} - {other}",
            *(str(n) for n in (one.both, one.only_first, one.only_second, one.neither)),
            p_value(one.p_value),
            p_value(holms),
            later(material, first, other),
        ]
        for (other, one), holms in zip(pairs.items(), adjusted, strict=True)
    ]
    header = ["", "both", "only the first", "only the second", "neither", "p", "p (Holm)"]
    return table([*header, "the second later [s]"], rows)


def later(material: Material, first: str, second: str) -> str:
    """Tell how much later the second method's vessels arrive where both methods succeed."""
    times: dict[str, dict[tuple[str, int], float]] = {first: {}, second: {}}
    for record in material.records:
        if record.variant == material.main and record.success and record.method in times:
            mean = fmean(vessel.travel_time_s for vessel in record.vessels)
            times[record.method][record.set, record.episode] = mean
    both = [key for key in times[first] if key in times[second]]
    return _interval(bootstrap_mean([[times[second][key] - times[first][key]] for key in both]))


def compare(material: Material, first: str, second: str) -> Paired:
    """Pair two methods' successes by set and episode, in the full simulator."""
    by_method: dict[str, dict[tuple[str, int], bool]] = {first: {}, second: {}}
    for record in material.records:
        if record.variant == material.main and record.method in by_method:
            by_method[record.method][record.set, record.episode] = record.success
    both = [key for key in by_method[first] if key in by_method[second]]
    return pair([by_method[first][key] for key in both], [by_method[second][key] for key in both])


def closest_approach(material: Material) -> str:
    """Percentiles of the vessels' closest approaches, over all sets."""
    rows = [
        [cell.method, *(number(value) for value in cell.closest_approach_m)]
        for cell in _pooled(material)
    ]
    return table(["[m]", "5 %", "25 %", "50 %"], rows)


def colregs(material: Material) -> str:
    """How the rules were kept, over all sets."""
    rows = []
    for cell in _pooled(material):
        for name, rule in (("head-on", cell.head_on), ("give-way", cell.give_way)):
            rows.append([cell.method, name, *_rule(rule)])
    header = ["", "", "encounters", "acted as asked", "touched", "deviations safer", "gained [m]"]
    return table(header, rows)


def effort(material: Material) -> str:
    """Energy, and how fast it was decided and simulated, over all sets."""
    rows = [
        [
            cell.method,
            number(cell.energy_kns, 1),
            *(number(value) for value in cell.decision_ms),
            number(cell.real_time_factor, 1),
        ]
        for cell in _pooled(material)
    ]
    header = ["", "energy [kN s]", "decision p50 [ms]", "p99 [ms]", "x real time"]
    return table(header, rows)


def gap(material: Material) -> str:
    """Success rates and times in the training environment, the simulator, and simpler ones."""
    names = ["all at once" if name.count("+") > 2 else name for name in material.variants]
    header = ["", "set", "training", *names]
    rows = []
    for method in material.methods:
        for i, one in enumerate(material.sets):
            trained = material.trained.get(method)
            column = NOTHING if trained is None else _both(
                trained[i].success_rate, trained[i].travel_time_s
            )  # fmt: skip
            cells = (material.cells.get((method, one, variant)) for variant in material.variants)
            rows.append([method, one, column, *(_cell(cell) for cell in cells)])
        cells = (material.pooled.get((method, variant)) for variant in material.variants)
        rows.append([method, "all", _trained(material, method), *(_cell(cell) for cell in cells)])
    return table(header, rows)


def assurance(material: Material) -> str:
    """Each method unchecked and checked by the assurance, over all sets."""
    rows = []
    for method in material.methods:
        for name, variant in (("without", UNASSURED), ("with", FULL)):
            cell = material.pooled.get((method, variant))
            if cell is not None:
                causes = (str(cell.failures[cause]) for cause in CAUSES)
                told = NOTHING if variant == UNASSURED else str(cell.interventions)
                rows.append([method, name, _success(cell), *causes, _time(cell), told])
    header = ["", "assurance", "success", *HEADERS.values()]
    return table([*header, "travel time [s]", "interventions"], rows)


def suite(counted: Sequence[Counted]) -> list[str]:
    """Give a suite's figures, a column a method and set; its tables, one each; its aims."""
    columns = [f"{one.method}, {one.set}" for one in counted]
    names = list(dict.fromkeys(name for one in counted for name in one.figures))
    plain = [n for n in names if not any(isinstance(o.figures.get(n), dict) for o in counted)]
    rows = [[name, *(_plain(one.figures.get(name)) for one in counted)] for name in plain]
    found = [table(["", *columns], rows)]
    for name in names:
        if name in plain:
            continue
        for column, one in zip(columns, counted, strict=True):
            found.append(_nested(f"{name}: {column}", one.figures.get(name) or {}))
    aims = [
        [column, words, "yes" if reached else "no"]
        for column, one in zip(columns, counted, strict=True)
        for words, reached in one.aims.items()
    ]
    return [*found, table(["", "aim", "reached"], aims)] if aims else found


def _nested(title: str, values: Mapping[str, Any]) -> str:
    """Give a table of numbers by row, or of rows of numbers by row and column."""
    if any(isinstance(value, Mapping) for value in values.values()):
        header = list(dict.fromkeys(key for row in values.values() for key in row))
        rows = [[name, *(_plain(row.get(k)) for k in header)] for name, row in values.items()]
        return table([title, *header], rows)
    return table([title, ""], [[name, _plain(value)] for name, value in values.items()])


def _plain(value: object) -> str:
    if isinstance(value, list | tuple):
        return " .. ".join(_plain(each) for each in value)
    return NOTHING if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def _pooled(material: Material) -> list[Cell]:
    cells = (material.pooled.get((method, material.main)) for method in material.methods)
    return [cell for cell in cells if cell is not None]


def _success(cell: Cell | None) -> str:
    if cell is None:
        return NOTHING
    low, high = (100 * end for end in cell.wilson95)
    return f"{share(cell.successes, cell.episodes)} [{low:.0f}, {high:.0f}]"


def _time(cell: Cell | None) -> str:
    if cell is None or cell.successes == 0:
        return NOTHING
    return _interval(cell.travel_time_s)


def _interval(estimate: tuple[float, float, float]) -> str:
    mean, low, high = estimate
    return NOTHING if math.isnan(mean) else f"{mean:.2f} [{interval(low, high)}]"


def _rule(rule: Rule) -> list[str]:
    return [
        str(rule.encounters),
        share(rule.acted, rule.encounters),
        str(rule.touched),
        share(rule.safer, rule.deviated),
        number(rule.gained_m),
    ]


def _cell(cell: Cell | None) -> str:
    return NOTHING if cell is None else _both(cell.success_rate, cell.travel_time_s[0])


def _trained(material: Material, method: str) -> str:
    scores = material.trained.get(method)
    if scores is None:
        return NOTHING
    episodes = sum(score.episodes for score in scores)
    rate = sum(score.success_rate * score.episodes for score in scores) / episodes
    return f"{100 * rate:.0f} %"


def _both(rate: float, time_s: float) -> str:
    return f"{100 * rate:.0f} %, {number(time_s, 1)} s" if rate else f"{100 * rate:.0f} %"
