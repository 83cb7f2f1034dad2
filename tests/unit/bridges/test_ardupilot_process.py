"""How an ArduRover simulator is started."""

from pathlib import Path

from twinscrew.hil_sim.autopilot.parameters import CALIBRATED, SHIPPED, SIMULATION
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


def test_it_can_be_armed_because_its_accelerometers_count_as_calibrated(tmp_path) -> None:
    Instance(0, 1, tmp_path).write_parameters()
    values = read_parm(tmp_path / "ardurover.parm")
    assert all(values[name] != 0.0 for name in CALIBRATED)


def test_no_boat_is_given_what_is_for_simulators_only() -> None:
    assert not set(read_parm(SIMULATION)) & set(read_parm(SHIPPED))


def test_a_memory_that_is_kept_is_wiped_only_where_there_is_none_yet(tmp_path) -> None:
    memory = tmp_path / "memory"
    instance = Instance(0, 1, tmp_path / "run", memory=memory)
    instance.write_parameters()
    assert "--wipe" in instance.command("ardurover")
    (memory / "eeprom.bin").write_bytes(b"what was written")
    assert "--wipe" not in instance.command("ardurover")
    assert instance.command_line("ardurover").startswith(f"cd {memory}")
    (tmp_path / "run" / "eeprom.bin").write_bytes(b"")
    assert "--wipe" in Instance(0, 1, tmp_path / "run").command("ardurover")
