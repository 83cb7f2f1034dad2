"""Whatever a station says, the companion does not fall over, and no order leads out of reach."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tests.harness.work import examples

from twinscrew.runtime.datum import Datum
from twinscrew.runtime.ground.orders import FollowRoute, GoTo, OrderSettings, Relative
from twinscrew.runtime.ground.stations import Stations
from twinscrew.runtime.mavlink import Wire

US = (1, 191)
SYDNEY = Datum(latitude_deg=-33.7221, longitude_deg=150.6739)
CLASSES = (
    mavlink.MAVLink_mission_count_message,
    mavlink.MAVLink_mission_item_message,
    mavlink.MAVLink_mission_item_int_message,
    mavlink.MAVLink_mission_request_message,
    mavlink.MAVLink_mission_request_int_message,
    mavlink.MAVLink_mission_request_list_message,
    mavlink.MAVLink_mission_clear_all_message,
    mavlink.MAVLink_mission_set_current_message,
    mavlink.MAVLink_mission_ack_message,
    mavlink.MAVLink_mission_write_partial_list_message,
    mavlink.MAVLink_command_long_message,
    mavlink.MAVLink_command_int_message,
    mavlink.MAVLink_set_position_target_local_ned_message,
    mavlink.MAVLink_set_position_target_global_int_message,
)
INTEGERS = {
    "uint8_t": (0, 2**8 - 1),
    "uint16_t": (0, 2**16 - 1),
    "int16_t": (-(2**15), 2**15 - 1),
    "uint32_t": (0, 2**32 - 1),
    "int32_t": (-(2**31), 2**31 - 1),
}
COMMANDS = (16, 21, 192, 193, 224, 300, 400, 512)


@st.composite
def messages(draw):
    """Any message that we take, its fields as wild as their types allow, but often to the point."""
    kind = draw(st.sampled_from(CLASSES))
    types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
    values = {}
    for name in kind.fieldnames:
        if types[name] == "float":
            values[name] = draw(st.floats(width=32))
        else:
            few, any_ = st.integers(0, 3), st.integers(*INTEGERS[types[name]])
            values[name] = draw(st.one_of(few, any_))
    values["target_system"], values["target_component"] = 1, draw(st.sampled_from((191, 0)))
    if "command" in values:
        values["command"] = draw(st.sampled_from(COMMANDS))
    if "frame" in values:
        values["frame"] = draw(st.sampled_from((0, 1, 3, 5, 6, 20)))
    return kind(**values)


@pytest.mark.slow
@settings(max_examples=examples(80), deadline=None)
@given(st.lists(messages(), max_size=8))
def test_nothing_that_is_said_breaks_it_and_no_goal_is_out_of_reach(said) -> None:
    limits = OrderSettings()
    stations = Stations(limits, SYDNEY, US)
    ear, mouth = Wire(*US), Wire(255, 190)
    for k, message in enumerate(said):
        for heard in ear.decode(mouth.encode(message)):
            stations.take(heard, k * 0.1)
        for reply in stations.due(k * 0.1):
            ear.encode(reply)  # every answer fits on the wire
    for order in stations.orders():
        if isinstance(order, GoTo) and order.relative is Relative.ORIGIN:
            assert math.hypot(order.x_m, order.y_m) <= limits.reach_m
        elif isinstance(order, GoTo):
            assert math.isfinite(order.x_m + order.y_m)
        elif isinstance(order, FollowRoute):
            assert order.way
            assert all(math.hypot(w.north_m, w.east_m) <= limits.reach_m for w in order.way)
