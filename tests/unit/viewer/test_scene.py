"""The chart kept beside the recordings."""

import pytest

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.viewer.scene import SCENE_FILE, Scene, read_scene, scene_of, write_scene
from twinscrew.runtime.errors import RecordingError


@pytest.mark.parametrize("name", ["random", "passage", "crossing"])
def test_a_scene_comes_back_as_it_was_written(name, tmp_path):
    scenario = load_scenario(name, buoys=3 if name == "random" else None, seed=4)
    write_scene(tmp_path, scenario)
    scene = read_scene(tmp_path)
    assert scene == scene_of(scenario)
    assert scene.names == scenario.names
    assert scene.buoys == tuple(map(tuple, scenario.buoys.tolist()))
    assert scene.quays == tuple(map(tuple, scenario.quays.tolist()))


def test_a_folder_without_a_scene_has_an_empty_one(tmp_path):
    assert read_scene(tmp_path) == Scene()


@pytest.mark.parametrize(
    "content",
    [b'{"buoys": 3}', b'{"names": ["\xff"]}', pytest.param(b'{"x": ' + b"[" * 100_000, id="deep")],
)
def test_a_damaged_scene_is_refused_by_name(tmp_path, content):
    (tmp_path / SCENE_FILE).write_bytes(content)
    with pytest.raises(RecordingError, match=SCENE_FILE):
        read_scene(tmp_path)
