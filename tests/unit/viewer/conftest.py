"""A short run, sailed once."""

import pytest

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.hil_sim.viewer.scene import write_scene


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    from dataclasses import replace

    folder = tmp_path_factory.mktemp("run")
    scenario = replace(load_scenario("crossing"), time_limit_s=6.0)
    sail(scenario, SitlSettings(lockstep=True), folder)
    write_scene(folder, scenario)
    return folder
