from pathlib import Path

import pytest
from msgspec.structs import replace
from tests.unit.report.results_folder import SETS, folder, made_up

from twinscrew.hil_sim.experiments.plan import SetSettings
from twinscrew.hil_sim.report.gallery import choose
from twinscrew.hil_sim.report.material import gather
from twinscrew.hil_sim.report.write import write_report
from twinscrew.runtime.errors import RecordingError


def test_a_report_says_what_was_sailed_and_shows_its_charts(tmp_path: Path) -> None:
    out = folder(tmp_path / "out", made_up())
    text = write_report(gather(out), trajectories=False).read_text()
    assert "12, 3 a set, method and variant" in text
    assert "Unfinished" not in text
    assert "From training to the simulator" not in text
    for name in ("success.png", "closest_approach.png"):
        assert f"](figures/{name})" in text
        assert (out / "figures" / name).read_bytes().startswith(b"\x89PNG")
        drawing = (out / "figures" / name).with_suffix(".svg")
        assert b"<svg" in drawing.read_bytes(), "to print"


def test_a_report_says_in_what_was_sailed_by_its_own_settings(tmp_path: Path) -> None:
    out = folder(tmp_path / "paper", made_up())
    paper = write_report(gather(out), trajectories=False).read_text()
    assert "In 10 m/s of wind, waves of 5 s and gain 0.3." in paper
    assert "under way for over 90 s; a vessel has arrived within" in paper
    assert "Surfaces are circles: vessels' of 2.8 m, buoys' 0.75 m." in paper
    still = ("no_wind", "no_waves", "goal_4m")
    records = [replace(one, variant="+".join(still)) for one in made_up()]
    (tmp_path / "calm.toml").write_text(
        'time_limit_s = 40\n[[vessel]]\ntype = "otter"\nstart_m = [0, 0]\nheading_deg = 0\n'
        'goal_m = [20, 0]\n[[vessel]]\ntype = "otter"\nstart_m = [20, 9]\nheading_deg = 180\n'
        "goal_m = [0, 9]\n"
    )
    sets = tuple(SetSettings(name=name, scenario=str(tmp_path / "calm.toml")) for name in SETS)
    out = folder(tmp_path / "calm", records, sets=sets, variants=(still,))
    calm = write_report(gather(out), trajectories=False).read_text()
    assert "In no wind, flat water." in calm
    assert "under way for over 40 s; a vessel has arrived within 4 m of its goal." in calm
    assert "buoys'" not in calm
    assert "2.8 m" not in calm


def test_an_unfinished_experiment_is_called_so(tmp_path: Path) -> None:
    out = folder(tmp_path / "out", made_up()[:7])
    text = write_report(gather(out), trajectories=False).read_text()
    assert "**Unfinished: 5 are missing.**" in text


def test_a_policy_that_is_not_there_any_more_costs_pictures_and_nothing_else(
    tmp_path: Path,
) -> None:
    out = folder(tmp_path / "out", made_up())
    text = write_report(gather(out), failures=1).read_text()
    assert "passage.png is missing: method 'ac_iqn'" in text
    assert "failure_1.png is missing: method 'apf'" in text
    assert not (out / "figures" / "passage.png").exists()


def test_the_gallery_shows_every_method_and_cause_before_a_second_of_any(tmp_path: Path) -> None:
    material = gather(folder(tmp_path / "out", made_up()))
    causes = [(record.method, record.cause, record.set[0]) for record in choose(material, 3)]
    assert causes == [("apf", "buoy", "3"), ("apf", "time", "3"), ("apf", "buoy", "5")]
    assert len(choose(material, 99)) == 4


def test_the_gallery_shows_every_method_before_another_cause_of_any(tmp_path: Path) -> None:
    records = made_up()
    failed = [
        replace(one, success=False, cause="vessel")
        if (one.method, one.set[0], one.episode) == ("ac_iqn", "5", 2)
        else one
        for one in records
    ]
    material = gather(folder(tmp_path / "out", failed))
    chosen = [(record.method, record.cause) for record in choose(material, 3)]
    assert chosen == [("ac_iqn", "vessel"), ("apf", "buoy"), ("apf", "time")]


def test_a_report_that_cannot_be_written_says_why(tmp_path: Path) -> None:
    out = folder(tmp_path / "out", made_up())
    (out / "figures").touch()
    with pytest.raises(RecordingError, match="File exists"):
        write_report(gather(out), trajectories=False)
