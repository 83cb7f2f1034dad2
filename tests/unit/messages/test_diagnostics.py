from twinscrew.runtime.messages.topics import type_store
from twinscrew.runtime.messages.types import HealthEvent, Severity
from twinscrew.runtime.messages.visual import (
    DIAGNOSTICS_TYPE,
    decode_diagnostics,
    encode_diagnostics,
)


def event(severity):
    return HealthEvent(stamp_ns=9, name="odometry_jump", severity=severity, detail="12 m")


def test_severities_are_ros_levels_and_come_back():
    for level, severity in enumerate((Severity.INFO, Severity.WARNING, Severity.ERROR)):
        payload = encode_diagnostics((event(severity),), stamp_ns=9, hardware_id="wamv1")
        status = type_store().deserialize_cdr(payload, DIAGNOSTICS_TYPE).status[0]
        assert (status.level, status.hardware_id) == (level, "wamv1")
        assert decode_diagnostics(payload) == (event(severity),)


def test_values_of_other_senders_are_stepped_over_and_stale_is_an_error():
    store = type_store()
    pair = store.types["diagnostic_msgs/msg/KeyValue"](key="rate", value="9.8")
    ours = encode_diagnostics((event(Severity.INFO),) * 2, stamp_ns=9)
    message = store.deserialize_cdr(ours, DIAGNOSTICS_TYPE)
    message.status[0].values = [pair, pair]
    message.status[0].level = 3
    payload = bytes(store.serialize_cdr(message, DIAGNOSTICS_TYPE))
    assert decode_diagnostics(payload) == (event(Severity.ERROR), event(Severity.INFO))


def test_no_events_are_a_message_too():
    assert decode_diagnostics(encode_diagnostics((), stamp_ns=0)) == ()
