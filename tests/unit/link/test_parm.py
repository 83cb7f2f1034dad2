import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.link.ardupilot.parameters import SHIPPED, read_parm


def write(tmp_path, text):
    path = tmp_path / "some.parm"
    path.write_text(text)
    return path


def test_names_and_values_are_read_in_both_ground_stations_dialects(tmp_path):
    text = "# a comment\nRC1_DZ 0 # why\nFS_TIMEOUT,1.5\n\n"
    assert read_parm(write(tmp_path, text)) == {"RC1_DZ": 0.0, "FS_TIMEOUT": 1.5}


@pytest.mark.parametrize(
    "line", ["RC1_DZ", "RC1_DZ x", "RC1_DZ nan", "rc1_dz 0", "A_NAME_OF_17_CHARS 0", "A 1 2"]
)
def test_a_line_that_is_no_parameter_is_named(tmp_path, line):
    with pytest.raises(ConfigError, match=r"some\.parm.*line 2"):
        read_parm(write(tmp_path, f"RC3_DZ 0\n{line}\n"))


def test_a_parameter_given_twice_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="twice"):
        read_parm(write(tmp_path, "RC1_DZ 0\nRC1_DZ 1\n"))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match="nowhere"):
        read_parm(tmp_path / "nowhere.parm")


def test_the_shipped_file_sets_what_the_measured_behaviour_needs():
    values = read_parm(SHIPPED)
    needed = {
        "FRAME_CLASS": 2,
        "SERVO1_FUNCTION": 73,
        "SERVO3_FUNCTION": 74,
        "PILOT_STEER_TYPE": 1,
        "RC1_DZ": 0,
        "RC3_DZ": 0,
        "MOT_SLEWRATE": 0,
        "FS_THR_ENABLE": 1,
    }
    assert {name: values[name] for name in needed} == needed
    assert "SYSID_MYGCS" in values
