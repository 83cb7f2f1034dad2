"""Charts as GeoJSON: what they become in frame N, and what is refused by name."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples

from twinscrew.runtime.charts.geojson import CLASSES, read_geojson
from twinscrew.runtime.charts.static_map import MOST_VERTICES, StaticMap
from twinscrew.runtime.datum import Datum, from_datum_N, positions_N, to_degrees
from twinscrew.runtime.errors import ConfigError

DATUM = Datum(latitude_deg=54.35, longitude_deg=10.13)
FILE = Path("harbour.geojson")
SQUARE = [(0.0, 0.0), (40.0, 0.0), (40.0, 30.0), (0.0, 30.0)]


def lon_lat(north, east):
    latitude, longitude = to_degrees(DATUM, np.array([north, east]))
    return [longitude, latitude]


def ring(places):
    return [lon_lat(*place) for place in (*places, places[0])]


def feature(geometry, places, **properties):
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": geometry, "coordinates": places},
    }


def collection(*features, **more):
    return {"type": "FeatureCollection", "features": list(features), **more}


def read(*features, **how):
    root = collection(*features)
    return read_geojson(json.dumps(root).encode(), FILE, DATUM, **how)


def refusal(root, **how):
    content = root if isinstance(root, bytes) else json.dumps(root).encode()
    with pytest.raises(ConfigError) as refused:
        read_geojson(content, FILE, DATUM, **how)
    assert str(refused.value).startswith("harbour.geojson: ")
    return str(refused.value)


@settings(max_examples=examples(50))
@given(
    latitude=st.floats(-85.0, 85.0),
    longitude=st.floats(-180.0, 180.0),
    offsets=st.lists(st.tuples(*[st.floats(-0.5, 0.5)] * 2), min_size=1, max_size=5),
)
def test_many_places_are_where_each_of_them_is(latitude, longitude, offsets):
    datum = Datum(latitude_deg=latitude, longitude_deg=longitude)
    degrees = np.array(
        [(latitude + a, (longitude + b + 180.0) % 360.0 - 180.0) for a, b in offsets]
    )
    expected = [from_datum_N(datum, *place)[:2] for place in degrees]
    np.testing.assert_allclose(positions_N(datum, degrees), expected, atol=1e-6)


def test_land_with_a_hole_is_forbidden_but_for_the_hole():
    pond = [(10.0, 10.0), (20.0, 10.0), (20.0, 20.0), (10.0, 20.0)]
    found = read(feature("Polygon", [ring(SQUARE), ring(pond)], twinscrew="land", name="Mole"))
    chart = StaticMap.of(found.features)
    places = np.array([[5.0, 5.0], [15.0, 15.0], [50.0, 5.0]])
    assert chart.forbidden(places).tolist() == [True, False, False]
    assert chart.why(places[0]) == "on land (Mole)"
    # North and east have not been exchanged.
    assert chart.forbidden(np.array([[39.0, 29.0], [29.0, 39.0]])).tolist() == [True, False]


def test_every_geometry_forbids_what_it_covers():
    found = read(
        feature("MultiPolygon", [[ring(SQUARE)]], twinscrew="keep_out"),
        feature("Point", lon_lat(100.0, 0.0), twinscrew="hazard", radius_m=2.0),
        feature("MultiPoint", [lon_lat(200.0, 0.0), lon_lat(210.0, 0.0)], twinscrew="hazard"),
        feature("LineString", [lon_lat(300.0, 0.0), lon_lat(300.0, 50.0)], twinscrew="land"),
        feature("MultiLineString", [[lon_lat(400.0, 0.0), lon_lat(400.0, 50.0)]],
                twinscrew="land", width_m=6.0),
        hazard_radius_m=4.0, line_width_m=2.0,
    )  # fmt: skip
    chart = StaticMap.of(found.features)
    inside = [[20.0, 20.0], [101.9, 0.0], [203.9, 0.0], [300.9, 25.0], [402.9, 25.0]]
    outside = [[42.0, 20.0], [102.3, 0.0], [205.0, 0.0], [301.1, 25.0], [403.1, 25.0]]
    assert chart.forbidden(np.array(inside)).all()
    assert not chart.forbidden(np.array(outside)).any()


@pytest.mark.parametrize(
    ("properties", "depth_m", "forbidden"),
    [
        ({"class": "LNDARE"}, 1.0, True),
        ({"layer": "lndare"}, 1.0, True),
        ({"class": "DEPARE", "DRVAL1": 0.5, "DRVAL2": 5.0}, 1.0, True),
        ({"class": "DEPARE", "DRVAL1": 2.0, "DRVAL2": 5.0}, 1.0, False),
        ({"class": "DEPARE", "DRVAL1": "2.0"}, 3.0, True),
        ({"class": "DEPARE"}, 1.0, True),
        ({"class": "UNSARE"}, 1.0, True),
        ({"class": "OBSTRN"}, 1.0, True),
        ({"class": "WRECKS", "VALSOU": 12.0}, 1.0, False),
        ({"class": "WRECKS", "VALSOU": 0.3}, 1.0, True),
        ({"class": "RESARE", "RESTRN": "7,14"}, 1.0, True),
        ({"class": "RESARE", "RESTRN": ["1"]}, 1.0, False),
        ({"class": "M_COVR"}, 1.0, False),
        ({"twinscrew": "ignore"}, 1.0, False),
        ({"twinscrew": "depth", "depth_m": 0.4}, 1.0, True),
        ({"twinscrew": "fence"}, 1.0, True),
    ],
)
def test_what_a_feature_is_decides_what_it_forbids(properties, depth_m, forbidden):
    far_rock = feature("Point", lon_lat(5000.0, 0.0), twinscrew="hazard")
    found = read(feature("Polygon", [ring(SQUARE)], **properties), far_rock)
    chart = StaticMap.of(found.features, safety_depth_m=depth_m)
    assert chart.forbidden(np.array([[20.0, 15.0]]))[0] == forbidden


def test_a_fence_to_be_kept_inside_of_forbids_the_outside():
    fence = feature("Polygon", [ring(SQUARE)], twinscrew="fence", keep_in=True, name="bay")
    chart = StaticMap.of(read(fence).features)
    assert chart.why(np.array([20.0, 15.0])) == ""
    assert chart.why(np.array([50.0, 15.0])) == "outside the fence (bay)"


def test_what_forbids_nothing_is_counted():
    land = feature("Polygon", [ring(SQUARE)], twinscrew="land")
    cover = feature("Polygon", [ring(SQUARE)], **{"class": "M_COVR"})
    away = feature("Point", lon_lat(60_000.0, 0.0), twinscrew="hazard")
    found = read(land, cover, cover, away)
    assert (len(found.features), found.ignored, found.far) == (1, {"M_COVR": 2}, 1)


def test_a_number_that_no_float_holds_is_refused_by_name():
    land = feature("Polygon", [ring(SQUARE)], twinscrew="land")
    place = feature("Point", [10.0, 10**400], twinscrew="hazard")
    assert "features[2].geometry.coordinates" in refusal(collection(land, place))
    rock = feature("Point", lon_lat(0, 0), twinscrew="hazard", radius_m=10**400)
    assert "features[1].properties.radius_m" in refusal(collection(rock))


def test_a_country_that_reaches_from_here_to_far_away_is_refused_not_left_out():
    rock = feature("Point", lon_lat(0, 99), twinscrew="hazard")
    country = [(0.0, 0.0), (1.2e6, 0.0), (1.2e6, 9e5), (0.0, 30.0)]
    words = refusal(collection(rock, feature("Polygon", [ring(country)], twinscrew="land")))
    assert "features[2].geometry.coordinates" in words
    assert "1000 km" in words


def test_a_far_away_fence_to_be_kept_inside_of_is_not_left_out():
    rock = feature("Point", lon_lat(0, 99), twinscrew="hazard")
    bay = [(80_000.0, 0.0), (90_000.0, 0.0), (90_000.0, 9_000.0), (80_000.0, 9_000.0)]
    found = read(rock, feature("Polygon", [ring(bay)], twinscrew="fence", keep_in=True))
    assert StaticMap.of(found.features).forbidden(np.array([[0.0, 0.0]]))[0]


BOW_TIE = [(0.0, 0.0), (10.0, 10.0), (10.0, 0.0), (0.0, 10.0)]


def test_a_self_crossing_ring_is_named_with_its_place_or_repaired_if_asked():
    tie = feature("Polygon", [ring(SQUARE), ring(BOW_TIE)], twinscrew="land")
    words = refusal(collection(feature("Point", lon_lat(0, 99), twinscrew="hazard"), tie))
    longitude, latitude = lon_lat(5.0, 5.0)
    assert "features[2].geometry.coordinates: ring 2: crosses itself" in words
    assert f"longitude {longitude:.6f}, latitude {latitude:.6f}" in words
    assert "chart.repair" in words
    alone = feature("Polygon", [ring(BOW_TIE)], twinscrew="land")
    found = read(alone, repair=True)
    chart = StaticMap.of(found.features)
    assert found.repaired == 1
    # The two triangles of the bow tie, not what lies beside its knot.
    places = np.array([[1.0, 5.0], [9.0, 5.0], [5.0, 1.0], [5.0, 9.0]])
    assert chart.forbidden(places).tolist() == [True, True, False, False] or (
        chart.forbidden(places).tolist() == [False, False, True, True]
    )


def test_exchanged_latitude_and_longitude_are_recognised():
    swapped = [[latitude, longitude] for longitude, latitude in ring(SQUARE)]
    words = refusal(collection(feature("Polygon", [swapped], twinscrew="land")))
    assert "latitude and longitude are exchanged" in words


def test_a_chart_of_another_place_is_refused_with_its_distance():
    words = refusal(collection(feature("Point", [10.13, 55.35], twinscrew="hazard")))
    assert "nothing of it is within 50 km of autopilot.datum" in words
    assert "111 km away" in words


def test_a_chart_in_another_coordinate_system_is_refused():
    utm = [[573_000.0, 6_023_000.0], [573_100.0, 6_023_000.0], [573_100.0, 6_023_100.0]]
    land = feature("Polygon", [[*utm, utm[0]]], twinscrew="land")
    assert "no degrees" in refusal(collection(land))
    name = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}
    assert "'urn:ogc:def:crs:EPSG::25832'" in refusal(collection(land, crs=name))
    fine = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
    root = collection(feature("Point", lon_lat(0, 0), twinscrew="hazard"), crs=fine)
    assert read_geojson(json.dumps(root).encode(), FILE, DATUM).features


CRS_NONE = feature("Point", lon_lat(0.0, 0.0), twinscrew="hazard")


@pytest.mark.parametrize(
    ("root", "words"),
    [
        (b"\xff\xfe", "not GeoJSON"),
        (b"[" * 100_000, "not GeoJSON"),
        ([], "'list' is not one of 'FeatureCollection', 'Feature'"),
        ({"type": "Polygon"}, "'Polygon' is not one of"),
        ({"type": "FeatureCollection"}, "features: expected a list"),
        (collection(), "an empty chart: it holds nothing at all"),
        (collection(feature("Polygon", [ring(SQUARE)], **{"class": "M_COVR"})), "holds M_COVR"),
        (collection(3), "features[1]: expected a Feature"),
        (collection(feature("Point", lon_lat(0, 0))), "features[1]: nothing says what it is"),
        (collection(feature("Point", lon_lat(0, 0), twinscrew="rock")),
         "features[1].properties.twinscrew: 'rock' is not one of 'land', 'keep_out'"),
        (collection(feature("Point", lon_lat(0, 0), **{"class": 71})), "a class of S-57"),
        (collection(feature("Point", ["a", 2], twinscrew="hazard")), "expected [longitude, lat"),
        (collection(CRS_NONE, feature("Point", [10.13, 91.0], twinscrew="hazard")),
         "features[2].geometry.coordinates: a point, place 1: longitude 10.13, latitude 91"),
        (collection(feature("Circle", lon_lat(0, 0), twinscrew="hazard")), "'Circle' is not one"),
        (collection(feature("Polygon", [ring(SQUARE)[:-1]], twinscrew="land")), "is not closed"),
        (collection(feature("Point", lon_lat(0, 0), twinscrew="hazard", radius_m=-1)),
         "properties.radius_m: got -1; allowed is 0.01 to"),
        (collection(feature("Point", lon_lat(0, 0), twinscrew="hazard", radius_m=True)), "radius"),
        (collection(feature("Point", lon_lat(0, 0), twinscrew="land", keep_in=True)), "fence"),
        (collection(feature("LineString", [lon_lat(0, 0)], twinscrew="land")), "single place"),
        (collection(feature("MultiPoint", [lon_lat(0, 0)] * (MOST_VERTICES + 1),
                            twinscrew="hazard")), "50001 places; allowed are at most 50000"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused_by_feature_and_key(root, words):
    assert words in refusal(root)


JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                [
                    "type",
                    "features",
                    "geometry",
                    "coordinates",
                    "properties",
                    "twinscrew",
                    "class",
                    "crs",
                ]
            ),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


@settings(max_examples=examples(200))
@given(value=JSON, geometry=JSON, properties=JSON)
def test_whatever_a_file_holds_it_is_read_or_refused(value, geometry, properties):
    broken = {"type": "Feature", "properties": {"twinscrew": "land"}, "geometry": geometry}
    strange = {**CRS_NONE, "properties": properties}
    typed = {**CRS_NONE, "geometry": {"type": "Polygon", "coordinates": value}}
    for root in (value, collection(value), collection(broken), collection(strange),
                 collection(typed)):  # fmt: skip
        try:
            found = read_geojson(json.dumps(root).encode(), FILE, DATUM)
        except ConfigError:
            continue
        assert all(math.isfinite(one.depth_m) or one.depth_m < 0 for one in found.features)


def test_the_classes_are_those_of_s57():
    assert all(len(name) == 6 and name.isupper() for name in CLASSES)
