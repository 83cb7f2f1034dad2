"""Radar scans and TTM sentences become plots."""

import math

import numpy as np
import pytest

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.marine import (
    RadarScan,
    Sentence,
    decode_radar_scan,
    encode_radar_scan,
    encode_sentence,
)
from twinscrew.runtime.messages.types import Odometry
from twinscrew.runtime.senses.nmea import NmeaLines
from twinscrew.runtime.senses.radar import Radar, RadarSettings, plots
from twinscrew.runtime.senses.ttm import Ttm, TtmSettings, checksum, read_ttm


def scan(distance, bearing, amplitude=None) -> RadarScan:
    count = len(distance)
    return RadarScan(
        stamp_ns=10**9,
        range_m=np.array(distance, float),
        bearing_rad=np.array(bearing, float),
        elevation_rad=np.zeros(count),
        doppler_mps=np.full(count, np.nan),
        amplitude=np.full(count, 20.0) if amplitude is None else np.array(amplitude, float),
    )


def own(heading: float = 0.0, p_N=(0.0, 0.0)) -> Odometry:
    return Odometry(
        stamp_ns=10**9,
        position_N=np.array([*p_N, 0.0]),
        q_NB=quaternion_from_euler(0.0, 0.0, heading),
        velocity_B=np.zeros(3),
        rates_B=np.zeros(3),
    )


def test_a_scan_survives_its_message():
    sent = scan([100.0, 250.5], [0.5, -2.0], [12.0, 30.0])
    read = decode_radar_scan(encode_radar_scan(sent))
    for name in ("range_m", "bearing_rad", "amplitude"):
        np.testing.assert_allclose(getattr(read, name), getattr(sent, name), rtol=1e-6)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0, 2e6])
def test_a_range_that_is_none_is_refused(bad):
    with pytest.raises(MessageError, match="no measurement"):
        decode_radar_scan(encode_radar_scan(scan([100.0, bad], [0.0, 0.0])))


def test_returns_that_touch_are_one_plot_also_across_the_stern():
    distance, bearing = plots(
        scan([100, 106, 100, 300, 300], [0.0, 0.02, 0.05, math.pi - 0.01, -math.pi + 0.01]),
        RadarSettings(),
    )
    assert len(distance) == 2
    np.testing.assert_allclose(np.sort(distance), [102, 300], atol=0.1)
    assert abs(abs(bearing[np.argmax(distance)]) - math.pi) < 1e-6


def test_the_strongest_returns_weigh_most_and_the_own_hull_is_not_seen():
    distance, _ = plots(scan([5.0, 100.0, 106.0], [0.0, 1.0, 1.0], [60, 10, 30]), RadarSettings())
    assert len(distance) == 1
    assert 104.0 < distance[0] < 106.0


def test_a_plot_lies_where_heading_and_position_put_it():
    radar = Radar(RadarSettings())
    payload = encode_radar_scan(scan([200.0], [math.pi / 2]))
    (look,) = radar.take(payload, 0, lambda _ns: own(math.pi / 2, (10.0, 20.0))).looks
    np.testing.assert_allclose(look.z, [(10.0 - 200.0, 20.0)], atol=1e-3)
    assert look.heading == pytest.approx(math.pi / 2)


def test_a_scan_without_odometry_is_not_used():
    heard = Radar(RadarSettings()).take(encode_radar_scan(scan([200.0], [0.0])), 0, lambda _: None)
    assert not heard.looks
    assert [event.name for event in heard.events] == ["odometry_missing"]


def ttm(number, distance, bearing, kind="T", unit="N", status="T") -> str:
    way = f"5.0,90.0,T,0.1,3.0,{unit},SHIP,{status},,120000.00,A"
    body = f"RATTM,{number:02d},{distance},{bearing},{kind},{way}"
    return f"${body}*{checksum(body):02X}"


def test_ttm_sentences_in_a_row_are_one_look():
    sense, looks = Ttm(TtmSettings()), []

    def says(t, text):
        payload = encode_sentence(Sentence(stamp_ns=round(t * 1e9), text=text))
        looks.extend(sense.take(payload, 0, lambda _ns: own(math.pi / 2)).looks)

    says(1.0, ttm(1, 1.0, 0.0))
    says(1.1, ttm(2, 0.5, 90.0, kind="R", unit="K"))
    says(1.2, ttm(3, 0.5, 90.0, status="L"))
    assert not looks
    says(3.5, ttm(1, 0.99, 0.0))
    (look,) = looks
    np.testing.assert_allclose(look.z, [(1852.0, 0.0), (-500.0, 0.0)], atol=1e-6)


@pytest.mark.parametrize(
    "text", ["$RATTM,01,1.0*00", ttm(1, "x", 0.0), ttm(1, 1.0, 400.0), "$RATTM"]
)
def test_a_sentence_that_is_none_is_refused(text):
    with pytest.raises(MessageError, match="TTM"):
        read_ttm(text, 0.0)


def test_lines_are_cut_wherever_the_bytes_end_and_garbage_is_left_out():
    lines = NmeaLines()
    stream = b"\x00\xff!!garbage\n!AIVDM,1\r\n$GPGGA,2\n" + b"x" * 300 + b"\n\\s:r*00\\!AIVDM,3\n"
    whole = NmeaLines().feed(stream)
    pieces = [text for k in range(0, len(stream), 7) for text in lines.feed(stream[k : k + 7])]
    assert pieces == whole == ["!AIVDM,1", "$GPGGA,2", "\\s:r*00\\!AIVDM,3"]
    assert lines.left_out == 2
    assert lines.feed(b"y" * 100_000) == []
    assert lines.feed(b"\n!AIVDM,4\n") == ["!AIVDM,4"]
