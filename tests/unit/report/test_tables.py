import json
from pathlib import Path

import pytest
from msgspec.structs import replace
from tests.unit.report.results_folder import folder, made_up

from twinscrew.hil_sim.report import tables
from twinscrew.hil_sim.report.material import Material, gather


@pytest.fixture
def material(tmp_path: Path) -> Material:
    return gather(folder(tmp_path / "out", made_up()))


def rows(text: str) -> dict[str, list[str]]:
    """Give a table's rows by their first cell."""
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines()]
    return {row[0]: row[1:] for row in cells[2:]}


def test_success_is_told_with_count_and_interval(material: Material) -> None:
    assert rows(tables.success(material)) == {
        "ac_iqn": ["100 % (3/3) [44, 100]"] * 2,
        "apf": ["33 % (1/3) [6, 79]"] * 2,
    }


def test_failures_are_told_by_cause(material: Material) -> None:
    assert rows(tables.failures(material))["apf"] == [
        "33 % (2/6) [10, 70]",
        "0",
        "2",
        "0",
        "0",
        "2",
    ]


def test_travel_times_stand_beside_the_papers(material: Material) -> None:
    told = rows(tables.travel_time(material))
    assert told["ac_iqn"][0].startswith("17.50 [16.50 .. 18.50]")
    assert told["ac_iqn, paper"] == ["17.22", "22.81"]
    assert told["apf"] == ["16.50 [16.50 .. 16.50]"] * 2


def test_the_first_method_is_paired_with_the_others_over_all_sets(material: Material) -> None:
    (told,) = rows(tables.paired(material)).values()
    assert told[:6] == ["2", "4", "0", "0", "0.125", "0.125"]  # p = 2 / 2^4


def test_travel_times_are_compared_where_both_methods_arrived(tmp_path: Path) -> None:
    slower = [
        replace(
            one,
            vessels=tuple(replace(v, travel_time_s=v.travel_time_s + 3.0) for v in one.vessels),
        )
        if one.method == "apf"
        else one
        for one in made_up()
    ]
    material = gather(folder(tmp_path / "out", slower))
    assert tables.later(material, "ac_iqn", "apf") == "3.00 [3.00 .. 3.00]"
    assert rows(tables.paired(material))["ac_iqn - apf"][-1] == "3.00 [3.00 .. 3.00]"
    nobody = [replace(one, success=False, cause="time") for one in slower]
    alone = gather(folder(tmp_path / "nobody", nobody))
    assert tables.later(alone, "ac_iqn", "apf") == "-"


def test_only_episodes_that_both_have_sailed_are_paired(tmp_path: Path) -> None:
    part = [record for record in made_up() if record.method == "ac_iqn" or record.episode < 2]
    material = gather(folder(tmp_path / "out", part))
    pairs = tables.compare(material, "ac_iqn", "apf")
    assert (pairs.both, pairs.only_first) == (2, 2)


def test_rules_closest_approach_and_effort_are_told_a_method_a_row(material: Material) -> None:
    head_on, give_way = (line.split(" | ") for line in tables.colregs(material).splitlines()[2:4])
    assert head_on[2:] == ["12", "50 % (6/12)", "0", "100 % (6/6)", "1.00 |"]
    assert give_way[2] == "0"
    assert rows(tables.closest_approach(material))["ac_iqn"] == ["2.00"] * 3
    assert rows(tables.effort(material))["ac_iqn"] == ["30.0", "0.50", "1.00", "20.0"]


def test_the_assurance_is_told_beside_its_absence(tmp_path: Path) -> None:
    records = made_up()
    bare = [replace(one, variant="no_assurance", success=True, cause=None) for one in records]
    checked = [
        replace(one, vessels=tuple(replace(v, interventions=2) for v in one.vessels))
        for one in records
    ]
    out = folder(tmp_path / "out", checked + bare, variants=((), ("no_assurance",)))
    told = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in tables.assurance(gather(out)).splitlines()[2:]
    ]
    assert [row[:2] for row in told[2:]] == [["apf", "without"], ["apf", "with"]]
    assert told[2][2].startswith("100 % (6/6)")
    assert told[3][3:8] == ["0", "2", "0", "0", "2"]
    assert [row[-1] for row in told] == ["-", "24", "-", "24"]


def test_tables_are_of_the_first_variant(tmp_path: Path) -> None:
    records = [replace(one, variant="no_assurance") for one in made_up()]
    material = gather(folder(tmp_path / "out", records, variants=(("no_assurance",),)))
    assert "33 % (2/6)" in tables.failures(material)


def test_the_gap_stands_between_training_and_every_variant(tmp_path: Path) -> None:
    records = made_up()
    calm = [replace(one, variant="no_wind", success=True, cause=None) for one in records]
    out = folder(tmp_path / "out", records + calm, variants=((), ("no_wind",)))
    file = tmp_path / "scores.json"
    scores = [{"success_rate": rate, "episodes": 50, "travel_time_s": 18.5} for rate in (0.9, 0.7)]
    file.write_text(json.dumps({"settings": scores}))
    text = tables.gap(gather(out, [f"apf={file}"]))
    told = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines()[2:]]
    assert told[3][:4] == ["apf", "3 rob 0 obs", "90 %, 18.5 s", "33 %, 16.5 s"]
    assert told[3][4].startswith("100 %")
    assert told[5][:3] == ["apf", "all", "80 %"]
    assert told[0][2] == "-"  # nobody has evaluated ac_iqn
