"""How an ArduRover simulator is started."""

from pathlib import Path

from twinscrew.hil_sim.bridges.ardupilot_process import Instance
from twinscrew.runtime.link.ardupilot.parameters import read_parm


def test_a_ground_station_is_called_by_the_second_serial_port() -> None:
    words = Instance(3, 4, Path("wamv4"), "10.0.0.9:14550").command("ardurover")
    assert words[words.index("--serial1") + 1] == "udpclient:10.0.0.9:14550"
    assert "--serial1" not in Instance(3, 4, Path("wamv4")).command("ardurover")


def test_the_simulator_has_no_receiver_so_that_a_dead_runtime_is_noticed(tmp_path) -> None:
    instance = Instance(0, 1, tmp_path)
    instance.write_parameters()
    values = read_parm(tmp_path / "ardurover.parm")
    assert values["SIM_RC_FAIL"] == 1
    assert values["FS_THR_ENABLE"] == 1
