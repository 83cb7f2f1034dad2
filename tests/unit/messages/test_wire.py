from typing import NamedTuple

import numpy as np
import pytest

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.wire import (
    FLAG,
    STRING,
    Layout,
    Reader,
    Writer,
    array,
    number,
    vector,
)


def body(writer):
    return writer.payload()[4:]


def test_numbers_are_aligned_to_their_size_from_the_end_of_the_header():
    writer = Writer()
    writer.values("B", 1, 1)
    writer.values("d", 8, 1.0)
    assert body(writer) == b"\x01" + bytes(7) + b"\x00\x00\x00\x00\x00\x00\xf0\x3f"


def test_a_string_has_its_length_with_the_zero_byte():
    writer = Writer()
    writer.string("boat")
    assert body(writer) == b"\x05\x00\x00\x00boat\x00"


def test_an_empty_sequence_of_large_numbers_is_not_aligned():
    writer = Writer()
    writer.array(np.zeros(0), np.float64)
    writer.values("B", 1, 7)
    assert body(writer) == b"\x00\x00\x00\x00\x07"


def test_a_string_of_length_zero_is_empty():
    assert Reader(b"\x00\x01\x00\x00" + bytes(4), "T").string() == ""


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int64])
def test_arrays_come_back_in_shape_and_may_be_written_to(dtype):
    numbers = np.arange(12, dtype=dtype).reshape(3, 2, 2)
    writer = Writer()
    writer.array(numbers, dtype)
    read = Reader(writer.payload(), "T").array(dtype, (2, 2))
    np.testing.assert_array_equal(read, numbers)
    assert read.dtype == dtype
    assert read.flags.writeable


def test_numbers_that_do_not_fill_the_elements_are_refused():
    writer = Writer()
    writer.array(np.zeros(5), np.float64)
    with pytest.raises(MessageError, match="T: 5 numbers do not make elements of 2"):
        Reader(writer.payload(), "T").array(np.float64, (2,))


def test_big_endian_is_read():
    reader = Reader(b"\x00\x00\x00\x00" + b"\x00\x00\x00\x02" + b"\x00\x00\x00\x05boat\x00", "T")
    assert reader.count(0) == 2
    assert reader.string() == "boat"


def test_a_sequence_longer_than_the_message_is_refused_before_it_is_made():
    payload = b"\x00\x01\x00\x00" + b"\xff\xff\xff\xff" + bytes(16)
    with pytest.raises(MessageError, match="4294967295 elements do not fit the 24 bytes"):
        Reader(payload, "T").array(np.float64)


class Sample(NamedTuple):
    count: int
    is_sound: bool
    name: str
    place: np.ndarray
    values: np.ndarray
    weights: np.ndarray


class Samples(NamedTuple):
    samples: tuple[Sample, ...]


SAMPLE = Layout(
    Sample,
    "tests/msg/Sample",
    alike="values",
    count=number("Q"),
    is_sound=FLAG,
    name=STRING,
    place=vector(2),
    values=array(np.float64),
    weights=array(np.int64),
)


@pytest.mark.parametrize("length", [0, 1, 7])
def test_a_table_reads_what_it_wrote_and_takes_every_byte(length: int) -> None:
    sample = Sample(7, True, "buoy", np.array([0.5, -2.0]), np.arange(2.0), np.arange(2))
    table = Layout(Samples, "tests/msg/Samples", samples=SAMPLE.sequence(8))
    payload = table.encode(Samples((sample,) * length))
    again = table.decode(payload)
    assert len(again.samples) == length
    assert table.encode(again) == payload
    for found in again.samples:
        assert found[:3] == sample[:3]
        np.testing.assert_array_equal(found.place, sample.place)
        np.testing.assert_array_equal(found.values, sample.values)
    with pytest.raises(MessageError, match=r"tests/msg/Samples: .*bytes follow"):
        table.decode(payload + bytes(8))
    if length:
        with pytest.raises(MessageError, match="tests/msg/Samples"):
            table.decode(payload[:-9])


def test_a_table_refuses_arrays_that_belong_together_and_differ() -> None:
    odd = Sample(7, False, "", np.zeros(2), np.zeros(3), np.zeros(2, np.int64))
    with pytest.raises(MessageError, match="the arrays of its values differ in length"):
        SAMPLE.decode(SAMPLE.encode(odd))
