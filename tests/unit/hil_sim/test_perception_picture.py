"""Pictures of a scan: objects, tracks and truth are in them."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from twinscrew.hil_sim.bench.perception_picture import draw_harbour, draw_open
from twinscrew.hil_sim.bench.scenes import open_water
from twinscrew.hil_sim.perceive.picture import draw
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import load_sensor

PNG = b"\x89PNG\r\n\x1a\n"
MARK = np.array([[5.0, -3.0, 1.0, 0.5, 2.8]])


@pytest.mark.slow
def test_open_water_and_a_harbour_are_drawn(tmp_path: Path) -> None:
    draw_open(tmp_path / "open.png", scans=4)
    draw_harbour(tmp_path / "harbour.png")
    for name in ("open.png", "harbour.png"):
        assert (tmp_path / name).read_bytes().startswith(PNG)


@pytest.mark.slow
def test_tracks_and_truth_change_the_picture(tmp_path: Path) -> None:
    ((cloud, odometry),) = open_water(1)
    perception = Perception(load_sensor("vrx32"))
    objects = perception.step(cloud, odometry.q_NB)
    pictures = set()
    for number, (truth, tracks) in enumerate([(None, None), (MARK, None), (None, MARK)]):
        file = tmp_path / f"{number}.png"
        draw(perception, cloud, objects, file, truth, tracks)
        pictures.add(file.read_bytes())
    assert len(pictures) == 3


def test_the_ranges_have_a_scale_of_colours(tmp_path: Path, monkeypatch) -> None:
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda self, *_, **__: drawn.append(self))
    ((cloud, odometry),) = open_water(1)
    perception = Perception(load_sensor("vrx32"))
    objects = perception.step(cloud, odometry.q_NB)
    draw(perception, cloud, objects, tmp_path / "scan.png")
    labels = [axes.get_ylabel() for axes in drawn[0].axes]
    assert "range [m]" in labels


@pytest.mark.parametrize(("suffix", "begin"), [(".svg", b"<?xml"), (".pdf", b"%PDF")])
def test_a_picture_can_be_had_for_print(tmp_path: Path, suffix: str, begin: bytes) -> None:
    ((cloud, odometry),) = open_water(1)
    perception = Perception(load_sensor("vrx32"))
    objects = perception.step(cloud, odometry.q_NB)
    draw(perception, cloud, objects, tmp_path / f"scan{suffix}")
    assert (tmp_path / f"scan{suffix}").read_bytes().startswith(begin)
