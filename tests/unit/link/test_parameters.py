from twinscrew.runtime.link.ardupilot.parameters import (
    AT_ONCE,
    TRIES,
    ParameterCheck,
    expected_parameters,
)

TARGET = 7


def converse(check, autopilot, *, seconds=60.0, hears=lambda now_s: True):
    """Let a check ask a dictionary; gives what it wrote there."""
    written = {}
    for k in range(round(seconds / 0.05)):
        now_s = k * 0.05
        for message in check.ask(TARGET, now_s):
            if message.param_id in autopilot and hears(now_s):
                answers = check.heard(message.param_id, autopilot[message.param_id], TARGET)
                for answer in answers:
                    written[answer.param_id] = answer.param_value
                    autopilot[answer.param_id] = answer.param_value
                    check.heard(answer.param_id, answer.param_value, TARGET)
    return written


def test_a_boat_set_up_as_shipped_has_nothing_wrong():
    check = ParameterCheck(expected_parameters(TARGET))
    converse(check, expected_parameters(TARGET))
    assert check.done
    assert check.wrong == ()


def test_overrides_count_only_from_our_own_system():
    assert expected_parameters(TARGET)["SYSID_MYGCS"] == TARGET


def test_what_is_wrong_is_said_with_what_it_must_be():
    autopilot = expected_parameters(TARGET) | {"RC1_DZ": 30.0, "SYSID_MYGCS": 255.0}
    check = ParameterCheck(expected_parameters(TARGET))
    converse(check, autopilot)
    assert set(check.wrong) == {"RC1_DZ is 30, must be 0", "SYSID_MYGCS is 255, must be 7"}


def test_a_parameter_that_is_missing_is_said_to_be():
    autopilot = expected_parameters(TARGET)
    del autopilot["MOT_SLEWRATE"]
    check = ParameterCheck(expected_parameters(TARGET))
    converse(check, autopilot)
    assert check.done
    assert check.wrong == ("MOT_SLEWRATE is missing, must be 0",)


def test_newer_firmwares_name_is_tried():
    autopilot = expected_parameters(TARGET)
    autopilot["MAV_GCS_SYSID"] = autopilot.pop("SYSID_MYGCS")
    check = ParameterCheck(expected_parameters(TARGET))
    converse(check, autopilot)
    assert check.wrong == ()


def test_lost_questions_are_asked_again():
    check = ParameterCheck(expected_parameters(TARGET))
    converse(check, expected_parameters(TARGET), hears=lambda now_s: int(now_s / 0.5) % 2 == 1)
    assert check.done
    assert check.wrong == ()


def test_the_line_is_never_flooded():
    check = ParameterCheck(expected_parameters(TARGET))
    assert len(check.ask(TARGET, 0.0)) == AT_ONCE
    assert check.ask(TARGET, 0.1) == []


def test_nothing_is_written_unless_wanted():
    autopilot = expected_parameters(TARGET) | {"RC1_DZ": 30.0}
    check = ParameterCheck(expected_parameters(TARGET))
    assert converse(check, autopilot) == {}


def test_wanted_writing_mends_what_is_wrong_and_nothing_else():
    autopilot = expected_parameters(TARGET) | {"RC1_DZ": 30.0}
    check = ParameterCheck(expected_parameters(TARGET), write=True)
    assert converse(check, autopilot) == {"RC1_DZ": 0.0}
    assert check.wrong == ()


def test_an_autopilot_that_will_not_be_written_is_not_begged_for_ever():
    check = ParameterCheck({"RC1_DZ": 0.0}, write=True)
    sent = [check.heard("RC1_DZ", 30.0, TARGET) for _ in range(50)]
    assert sum(map(len, sent)) == TRIES
    assert check.wrong == ("RC1_DZ is 30, must be 0",)


def test_values_that_travelled_as_32_bit_floats_are_the_same():
    check = ParameterCheck({"FS_TIMEOUT": 1.1})
    check.heard("FS_TIMEOUT", 1.100000023841858, TARGET)
    assert check.wrong == ()


def test_what_was_written_is_told_once_with_what_it_was():
    autopilot = expected_parameters(TARGET) | {"RC1_DZ": 30.0, "MOT_SLEWRATE": 50.0}
    check = ParameterCheck(expected_parameters(TARGET), write=True)
    converse(check, autopilot)
    assert check.take_written() == ["RC1_DZ was 30, is 0 now", "MOT_SLEWRATE was 50, is 0 now"]
    assert check.take_written() == []


def test_a_refused_write_is_not_told_as_done():
    check = ParameterCheck({"RC1_DZ": 0.0}, write=True)
    check.heard("RC1_DZ", 30.0, TARGET)
    check.heard("RC1_DZ", 30.0, TARGET)
    assert check.take_written() == []


def test_the_state_of_each_parameter_is_known():
    autopilot = expected_parameters(TARGET) | {"RC1_DZ": 30.0}
    del autopilot["FS_ACTION"]
    check = ParameterCheck(expected_parameters(TARGET))
    assert all(state.found is None for state in check.states)
    converse(check, autopilot)
    states = {state.name: state for state in check.states}
    assert set(states) == set(expected_parameters(TARGET))
    wrong = {name for name, state in states.items() if not state.right}
    assert wrong == {"RC1_DZ", "FS_ACTION"}
    assert (states["RC1_DZ"].found, states["RC1_DZ"].wanted) == (30.0, 0.0)
    assert states["FS_ACTION"].missing
