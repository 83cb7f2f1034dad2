"""`twinscrew chart import`: charts of other formats become what a boat reads."""

import json

import numpy as np
import pyogrio
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.commands import as_json, twinscrew
from tests.harness.s57 import Cell
from tests.harness.work import examples

from twinscrew.hil_sim.chart_import import MOST_BYTES, draw_chart, import_chart
from twinscrew.runtime.charts.geojson import read_geojson
from twinscrew.runtime.charts.static_map import StaticMap
from twinscrew.runtime.datum import Datum, to_degrees
from twinscrew.runtime.errors import ConfigError

DATUM = Datum(latitude_deg=54.35, longitude_deg=10.13)
MOLE = [(0.0, 0.0), (100.0, 0.0), (100.0, 20.0), (0.0, 20.0)]
SHOAL = [(0.0, 50.0), (100.0, 50.0), (100.0, 90.0), (0.0, 90.0)]
BASIN = [(0.0, 100.0), (100.0, 100.0), (100.0, 140.0), (0.0, 140.0)]
ROCK, WRECK = (150.0, 10.0), (160.0, 60.0)
PLACES = np.array([[50.0, 10.0], [50.0, 70.0], [50.0, 120.0], ROCK, WRECK, [130.0, 30.0]])
FORBIDDEN = [True, True, False, True, False, False]


def degrees(place):
    return to_degrees(DATUM, np.array(place))


def lon_lat(places):
    return [degrees(place)[::-1] for place in places]


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    made = Cell()
    made.area("LNDARE", [degrees(p) for p in MOLE], OBJNAM="Mole")
    made.area("DEPARE", [degrees(p) for p in SHOAL], DRVAL1=0.5, DRVAL2=2)
    made.area("DEPARE", [degrees(p) for p in BASIN], DRVAL1=4, DRVAL2=6)
    made.area("M_COVR", [degrees(p) for p in (*MOLE[:2], *BASIN[2:])])
    made.point("UWTROC", degrees(ROCK))
    made.point("OBSTRN", degrees(WRECK), VALSOU=8.5)
    return made.write(tmp_path_factory.mktemp("enc") / "DE5KIEL1.000")


def forbidden(root, places=PLACES, safety_depth_m=1.0):
    read = read_geojson(json.dumps(root).encode(), "map.geojson", DATUM)
    return StaticMap.of(read.features, safety_depth_m=safety_depth_m).forbidden(places).tolist()


def test_an_s57_cell_becomes_a_chart_that_forbids_what_it_says(cell):
    imported = import_chart(cell)
    assert forbidden(imported.root) == FORBIDDEN
    assert imported.skipped["M_COVR"] == 1
    assert {one.name for one in imported.chart.features} == {"Mole", ""}


def test_the_command_writes_the_chart_a_picture_and_what_it_found(cell, tmp_path):
    out, picture = tmp_path / "map.geojson", tmp_path / "map.png"
    words = ("--out", out, "--picture", picture, "--json")
    report = as_json(twinscrew("chart", "import", cell, *words))
    assert report["features"] == {"depth": 3, "hazard": 1, "land": 1}
    assert abs(report["middle"]["latitude_deg"] - 54.35) < 0.01
    assert forbidden(json.loads(out.read_text())) == FORBIDDEN
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert picture.stat().st_size > 10_000
    again = as_json(twinscrew("chart", "import", out, "--out", tmp_path / "b.geojson", "--json"))
    assert again["features"] == report["features"]


def shapefile(path, shapes, crs, fields=None):
    fields = fields or {}
    pyogrio.raw.write(path, shapely.to_wkb(np.array(shapes, object)),
                      [np.array(v) for v in fields.values()], list(fields),
                      geometry_type=shapes[0].geom_type, crs=crs)  # fmt: skip
    return path


def test_a_shapefile_in_another_coordinate_system_is_turned_into_degrees(tmp_path):
    import pyproj

    turn = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:25832", always_xy=True)
    utm = [turn.transform(*place) for place in lon_lat(MOLE)]
    file = shapefile(tmp_path / "lndare.shp", [shapely.Polygon(utm)], "EPSG:25832")
    assert forbidden(import_chart(file).root) == [True, False, False, False, False, False]
    land = shapefile(tmp_path / "walls.shp", [shapely.Polygon(utm)], "EPSG:25832", {"FID": [7]})
    with pytest.raises(ConfigError, match=r"'WALLS'; expected a class|empty chart"):
        import_chart(land)
    assert forbidden(import_chart(land, kind="land").root)[0]


def test_a_shapefile_that_does_not_say_its_coordinate_system_is_asked_for(tmp_path):
    file = shapefile(tmp_path / "LNDARE.shp", [shapely.Polygon(lon_lat(MOLE))], "EPSG:4326")
    (tmp_path / "LNDARE.prj").unlink()
    with pytest.raises(ConfigError, match="--crs EPSG:4326"):
        import_chart(file)
    assert forbidden(import_chart(file, crs="EPSG:4326").root)[0]
    with pytest.raises(ConfigError, match="coordinate system 'EPSG:nine'"):
        import_chart(file, crs="EPSG:nine")


def test_an_outline_that_crosses_itself_is_refused_or_repaired(tmp_path):
    tie = [MOLE[0], MOLE[2], MOLE[1], MOLE[3]]
    file = shapefile(tmp_path / "LNDARE.shp", [shapely.Polygon(lon_lat(tie))], "EPSG:4326")
    with pytest.raises(ConfigError, match=r"features\[1\].*ring 1: crosses itself"):
        import_chart(file)
    imported = import_chart(file, repair=True)
    assert imported.chart.repaired == 1
    StaticMap.of(read_geojson(json.dumps(imported.root).encode(), "m", DATUM).features)


def test_a_file_that_is_too_large_or_no_chart_is_refused(tmp_path):
    large = tmp_path / "DE1LARGE.000"
    with large.open("wb") as file:
        file.truncate(2 * MOST_BYTES)
    with pytest.raises(ConfigError, match=r"DE1LARGE.000: has 200 MB; allowed are at most 100 MB"):
        import_chart(large)
    for name, content in (("noise.000", b"\x01\x02"), ("broken.geojson", b"{"), ("a.shp", b"")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ConfigError, match=name):
            import_chart(tmp_path / name)
    with pytest.raises(ConfigError, match="No such file"):
        import_chart(tmp_path / "none.shp")


def test_a_damaged_cell_is_refused(cell, tmp_path):
    content = cell.read_bytes()
    file = tmp_path / "DE5KIEL1.000"
    file.write_bytes(content[: len(content) // 2])
    with pytest.raises(ConfigError):
        import_chart(file)


@settings(max_examples=examples(20))
@given(
    radii=st.lists(st.floats(5.0, 80.0), min_size=5, max_size=40),
    most_m=st.floats(0.2, 8.0),
    points=st.lists(st.tuples(*[st.floats(-100.0, 100.0)] * 2), min_size=1, max_size=40),
)
def test_what_is_forbidden_stays_so_when_a_chart_is_simplified(
    tmp_path_factory, radii, most_m, points
):
    bearings = np.linspace(0.0, 2.0 * np.pi, len(radii), endpoint=False)
    around = np.array(radii)[:, None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    ring = lon_lat([*around, around[0]])
    rocks = [lon_lat([(200.0 + 10.0 * i, 0.0)])[0] for i in range(5)]
    root = {"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {"twinscrew": "land"},
         "geometry": {"type": "Polygon", "coordinates": [ring]}},
        *({"type": "Feature", "properties": {"twinscrew": "hazard", "radius_m": 1.0},
           "geometry": {"type": "Point", "coordinates": rock}} for rock in rocks)]}  # fmt: skip
    file = tmp_path_factory.mktemp("simple") / "map.geojson"
    file.write_text(json.dumps(root))
    imported = import_chart(file, simplify_m=most_m)
    places = np.array(points)
    before, after = forbidden(root, places), forbidden(imported.root, places)
    assert all(now for was, now in zip(before, after, strict=True) if was)
    # It does not grow by more than is promised, a corner's mitre apart.
    read = read_geojson(json.dumps(root).encode(), "map.geojson", DATUM)
    away = StaticMap.of(read.features).distance_m(places)
    assert not any(np.array(after)[away > 6.0 * most_m + 0.1])
    kept = [one for one in imported.chart.features if one.kind == "hazard"]
    assert len(kept) == 5
    rocky = np.array([[200.0 + 10.0 * i, 0.0] for i in range(5)])
    assert all(forbidden(imported.root, rocky))


def test_simplifying_saves_places(tmp_path):
    bearings = np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False)
    circle = 100.0 * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    file = shapefile(tmp_path / "LNDARE.shp", [shapely.Polygon(lon_lat(circle))], "EPSG:4326")
    imported = import_chart(file, simplify_m=1.0)
    assert imported.places_before == 2001
    assert imported.places < 40


def test_a_picture_shows_each_kind(cell, tmp_path):
    draw_chart(import_chart(cell), tmp_path / "map.svg", safety_depth_m=1.0)
    drawn = (tmp_path / "map.svg").read_text()
    assert all(word in drawn for word in ("#e8d9a0", "#a9cfe0", "#c0392b"))
