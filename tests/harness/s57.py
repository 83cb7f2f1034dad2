"""Writes small S-57 cells: GDAL makes the file's head, the objects follow record by record.

GDAL's S-57 writer begins a cell with its data descriptive record and its parameters, but no
library of ours can hand it features. Source: IHO S-57 edition 3.1, part 3; ISO 8211.
"""

from __future__ import annotations

import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyogrio
import shapely

POINT, LINE, AREA = 1, 2, 3
CODES = {"LNDARE": 71, "DEPARE": 42, "UWTROC": 153, "OBSTRN": 86, "M_COVR": 302, "COALNE": 30}
ATTRIBUTES = {"DRVAL1": 87, "DRVAL2": 88, "VALSOU": 179, "OBJNAM": 116}
SCALE = 10_000_000
"""[1/deg] COMF of the head that GDAL writes."""
ISOLATED, CONNECTED, EDGE = 110, 120, 130
"""RCNM of vector records."""


class Cell:
    """A cell that grows; `write` puts it into a file.

    Places are (latitude, longitude) [deg].
    """

    def __init__(self) -> None:
        self._records: list[bytes] = []
        self._vectors = self._features = 0

    def point(self, kind: str, place: tuple[float, float], **attributes: object) -> None:
        """Add an object at a point."""
        node = self._vector(ISOLATED, [("SG2D", _places([place]))])
        self._feature(kind, POINT, [(ISOLATED, node)], attributes)

    def area(self, kind: str, ring: list[tuple[float, float]], **attributes: object) -> None:
        """Add an area; its ring is not closed."""
        node = self._vector(CONNECTED, [("SG2D", _places(ring[:1]))])
        ends = b"".join(_name(CONNECTED, node) + bytes([255, 255, end, 255]) for end in (1, 2))
        edge = self._vector(EDGE, [("VRPT", ends), ("SG2D", _places(ring[1:]))])
        self._feature(kind, AREA, [(EDGE, edge)], attributes)

    def write(self, file: Path) -> Path:
        """Write the cell; its name has eight letters and the end .000."""
        nowhere = shapely.to_wkb(np.array([shapely.Point(0.0, 0.0)]))
        with suppress(pyogrio.errors.DataLayerError):  # the head is written, then it gives up
            pyogrio.raw.write(file, nowhere, [], [], driver="S57", geometry_type="Point",
                              crs="EPSG:4326", layer="UWTROC")  # fmt: skip
        with file.open("ab") as cell:
            cell.writelines(self._records)
        return file

    def _vector(self, kind: int, fields: list[tuple[str, bytes]]) -> int:
        self._vectors += 1
        head = struct.pack("<BIHB", kind, self._vectors, 1, 1)
        self._add([("VRID", head), *fields])
        return self._vectors

    def _feature(
        self, kind: str, shape: int, parts: list[tuple[int, int]], attributes: dict[str, object]
    ) -> None:
        self._features += 1
        number = self._features
        fields = [
            ("FRID", struct.pack("<BIBBHHB", 100, number, shape, 1, CODES[kind], 1, 1)),
            ("FOID", struct.pack("<HIH", 540, number, 1)),
        ]
        if attributes:
            said = (
                struct.pack("<H", ATTRIBUTES[name]) + str(value).encode() + b"\x1f"
                for name, value in attributes.items()
            )
            fields.append(("ATTF", b"".join(said)))
        outer = (1, 1, 255) if shape == AREA else (255, 255, 255)
        fields.append(("FSPT", b"".join(_name(*part) + bytes(outer) for part in parts)))
        self._add(fields)

    def _add(self, fields: list[tuple[str, bytes]]) -> None:
        """Add an ISO 8211 data record: leader, directory, fields."""
        number = len(self._records) + 3  # after the two of the head
        area, directory = b"", ""
        for tag, data in [("0001", struct.pack("<H", number)), *fields]:
            directory += f"{tag}{len(data) + 1:05d}{len(area):05d}"
            area += data + b"\x1e"
        base = 24 + len(directory) + 1
        leader = f"{base + len(area):05d} D     {base:05d}   5504"
        self._records.append(f"{leader}{directory}\x1e".encode() + area)


def _name(kind: int, number: int) -> bytes:
    return struct.pack("<BI", kind, number)


def _places(places: list[tuple[float, float]]) -> bytes:
    return b"".join(struct.pack("<ii", *(round(v * SCALE) for v in place)) for place in places)
