from typing import Any, NamedTuple

import numpy as np
import pytest

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.point_cloud import DATATYPES, read_points

NUMBERS = {code: number for number, code in DATATYPES.items()}


class PointField(NamedTuple):
    name: str
    offset: int
    datatype: int


def message(
    dtype: np.dtype[Any], values: dict[str, Any], shape: tuple[int, int], row_padding: int = 0
) -> dict[str, Any]:
    """Lay values out as a publisher would; returns read_points' arguments."""
    records = np.zeros(shape, dtype)
    for name, column in values.items():
        records[name] = np.asarray(column).reshape(shape)
    rows = records.view(np.uint8).reshape(shape[0], shape[1] * dtype.itemsize)
    data = np.pad(rows, ((0, 0), (0, row_padding)), constant_values=7).reshape(-1)
    fields = []
    for name in dtype.names or ():
        kind, offset = dtype.fields[name][:2]  # type: ignore[index]
        fields.append(PointField(name, offset, NUMBERS[kind.str[1:]]))
    return {
        "data": data,
        "fields": fields,
        "width": shape[1],
        "height": shape[0],
        "point_step": dtype.itemsize,
        "row_step": shape[1] * dtype.itemsize + row_padding,
        "is_bigendian": dtype["x"].byteorder == ">",
    }


def layout(order: str = "<", number: str = "f4", ring: str = "u2", step: int = 48) -> np.dtype[Any]:
    return np.dtype(
        {
            "names": ["intensity", "z", "x", "y", "ring", "extra"],
            "formats": [order + "f4", *3 * [order + number], order + ring, order + "i4"],
            "offsets": [0, 4, 13, 21, 30, 40],
            "itemsize": step,
        }
    )


XYZ = np.arange(1.0, 19.0).reshape(6, 3)
VALUES = {
    "x": XYZ[:, 0],
    "y": XYZ[:, 1],
    "z": XYZ[:, 2],
    "intensity": np.arange(6) * 0.5,
    "ring": np.arange(6),
    "extra": np.full(6, -1),
}


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("number", ["f4", "f8"])
@pytest.mark.parametrize("ring", ["u1", "i2", "u2", "u4"])
@pytest.mark.parametrize(("shape", "padding"), [((1, 6), 0), ((2, 3), 0), ((3, 2), 5)])
def test_any_layout_gives_the_same_points_in_forward_starboard_down(
    order: str, number: str, ring: str, shape: tuple[int, int], padding: int
) -> None:
    points = read_points(**message(layout(order, number, ring), VALUES, shape, padding))
    assert points.points_S.dtype == np.float32
    assert points.points_S.flags.c_contiguous
    assert points.points_S == pytest.approx(XYZ * [1, -1, -1])
    assert points.intensity == pytest.approx(VALUES["intensity"])
    assert points.ring is not None
    assert points.ring.dtype == np.uint16
    assert points.ring.tolist() == list(range(6))
    assert points.time_offset_s is None


def plain(*names: str, number: str = "f4") -> np.dtype[Any]:
    return np.dtype([(name, "<" + number) for name in names])


def test_fields_that_are_absent_are_none() -> None:
    points = read_points(**message(plain("x", "y", "z"), {}, (1, 4)))
    assert points.points_S.shape == (4, 3)
    assert points.intensity is points.ring is points.time_offset_s is None


def test_an_empty_cloud_is_normal() -> None:
    points = read_points(**message(layout(), {}, (1, 0)))
    assert points.points_S.shape == (0, 3)
    assert points.ring is not None
    assert points.ring.shape == (0,)
    assert read_points(**message(layout(), {}, (0, 5))).points_S.shape == (0, 3)


@pytest.mark.parametrize(
    ("name", "number", "value", "seconds"),
    [
        ("t", "<u4", 50_000_000, 0.05),
        ("time", "<f4", -0.02, -0.02),
        ("offset_time", "<u4", 1_000, 1e-6),
        ("timestamp", "<f8", 1_700_000_000.25, 0.25),
        ("timestamp", "<f8", 1_700_000_000.25e9, 0.25),
        ("timestamp", ">f8", 1_700_000_000.25e6, 0.25),
        ("timestamp", "<f8", 0.05, 0.05),
        ("time", "<f8", 1_700_000_000.25, 0.25),
        ("t", "<f8", -0.05, -0.05),
        ("timestamp", "<f8", 300.0, 300.0),  # of another clock: nobody can know
    ],
)
def test_times_are_seconds_after_the_stamp(
    name: str, number: str, value: float, seconds: float
) -> None:
    order = number[0]
    dtype = np.dtype([(axis, order + "f4") for axis in "xyz"] + [(name, number)])
    points = read_points(
        **message(dtype, {name: [value] * 3}, (1, 3)), stamp_ns=1_700_000_000_000_000_000
    )
    assert points.time_offset_s is not None
    assert points.time_offset_s == pytest.approx(seconds, rel=1e-4)


def test_a_ring_beyond_sixteen_bits_stays_the_greatest_number() -> None:
    values = VALUES | {"ring": [0, 1, 65_535, 65_536, 2**32 - 1, 5]}
    points = read_points(**message(layout(ring="u4"), values, (1, 6)))
    assert points.ring is not None
    assert points.ring.tolist() == [0, 1, 65_535, 65_535, 65_535, 5]


@pytest.mark.parametrize("number", ["<f4", ">f8", "<i1", ">i4"])
def test_a_ring_of_any_type_costs_no_scan(number: str) -> None:
    dtype = np.dtype([(axis, number[0] + "f4") for axis in "xyz"] + [("ring", number)])
    rings = [0, 5, -1, 100]
    if "f" in number:
        rings[3] = np.nan
    points = read_points(**message(dtype, {"ring": rings}, (2, 2)))
    assert points.ring is not None
    assert points.ring.tolist() == [0, 5, 0, 0 if "f" in number else 100]


def test_of_fields_with_the_same_name_the_first_counts() -> None:
    again = message(plain("x", "y", "z"), {"x": [3.0], "y": [0.0], "z": [0.0]}, (1, 1))
    again["fields"].append(PointField("x", 4, 7))
    assert read_points(**again).points_S[0, 0] == 3.0


def test_points_without_an_echo_do_not_hide_what_the_times_are() -> None:
    dtype = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("timestamp", "<f8")])
    values = {"timestamp": [np.nan, 0.0, 1_000.05e9, np.inf]}
    points = read_points(**message(dtype, values, (1, 4)), stamp_ns=1_000_000_000_000)
    assert points.time_offset_s is not None
    assert points.time_offset_s[2] == pytest.approx(0.05, abs=1e-4)


def test_times_in_the_first_seconds_of_a_simulation_are_after_the_stamp_too() -> None:
    dtype = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("timestamp", "<f8")])
    for told in ([5.02, 5.1], [0.02, 0.1]):
        points = read_points(**message(dtype, {"timestamp": told}, (1, 2)), stamp_ns=5_000_000_000)
        assert points.time_offset_s == pytest.approx([0.02, 0.1])


def test_numbers_beyond_float32_become_infinite_without_a_warning() -> None:
    values = {"x": [1e300], "y": [0.0], "z": [np.nan]}
    point = read_points(**message(plain("x", "y", "z", number="f8"), values, (1, 1))).points_S[0]
    assert point[0] == np.inf
    assert np.isnan(point[2])


def test_the_message_is_left_as_it_was() -> None:
    arguments = message(layout(), VALUES, (1, 6))
    before = arguments["data"].copy()
    arguments["data"].flags.writeable = False
    points = read_points(**arguments)
    points.points_S[:] = 0.0
    assert (arguments["data"] == before).all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"height": 3}, "288 bytes of data, but 3 rows of 288"),
        ({"row_step": 0}, "288 bytes of data"),
        ({"width": 7}, "cannot hold 7 points"),
        ({"width": 2**62, "height": 1}, "cannot hold"),
        ({"width": -1}, "negative"),
        ({"point_step": 20}, "field 'y' at byte 21"),
        ({"fields": [PointField("x", 0, 7), PointField("y", 4, 7)]}, "no field 'z'"),
        ({"fields": [PointField(n, 0, 5) for n in "xyz"]}, "'x' is of unusable type int32"),
        ({"fields": [PointField(n, 0, 9) for n in "xyz"]}, "datatype 9 is not one of"),
        ({"fields": [PointField(n, -4, 7) for n in "xyz"]}, "field 'x' at byte -4"),
        ({"fields": [PointField(n, 45, 7) for n in "xyz"]}, "field 'x' at byte 45"),
        ({"data": np.zeros((6, 48), np.uint8)}, "bytes of data"),
    ],
)
def test_a_cloud_that_contradicts_itself_is_refused_by_name(
    change: dict[str, Any], words: str
) -> None:
    with pytest.raises(MessageError, match=words):
        read_points(**(message(layout(), VALUES, (1, 6)) | change))


def test_clouds_of_many_layouts_in_turn_are_each_read_by_their_own() -> None:
    """A layout is checked once and kept: what is kept of one must not serve for another."""
    steps = (48, 52, 56, 60, 64, 68, 72, 76, 80, 84)  # more than are kept
    clouds = [message(layout(order, step=step), VALUES, (2, 3)) for step in steps for order in "<>"]
    for _ in range(2):
        for cloud in clouds:
            points = read_points(**cloud)
            np.testing.assert_array_equal(points.points_S, XYZ * (1.0, -1.0, -1.0))
            np.testing.assert_array_equal(points.intensity, VALUES["intensity"])
            np.testing.assert_array_equal(points.ring, VALUES["ring"])
