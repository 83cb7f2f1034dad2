from pathlib import Path

import numpy as np
import pytest

from twinscrew.hil_sim.perceive.files import decompress, read_cloud
from twinscrew.runtime.errors import MessageError

XYZ = np.array([[1.5, -2.0, 0.25], [3.0, 4.0, -5.0], [7.0, 8.0, 9.0], [0.5, 0.5, 0.5]], np.float32)
FIELDS = "FIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 4\nHEIGHT 1\n"


def with_columns(count: int) -> np.ndarray:
    return np.concatenate([XYZ, np.full((len(XYZ), count - 3), 0.3, np.float32)], axis=1)


@pytest.mark.parametrize("columns", [4, 5])
def test_a_bin_has_rows_of_four_or_five(tmp_path: Path, columns: int) -> None:
    file = tmp_path / "cloud.bin"
    file.write_bytes(with_columns(columns)[:3].astype("<f4").tobytes())
    assert read_cloud(file).points.tolist() == XYZ[:3].tolist()


@pytest.mark.parametrize("columns", [4, 5])
def test_whole_numbers_in_every_fifth_place_are_rings(tmp_path: Path, columns: int) -> None:
    rows = np.tile(with_columns(columns), (5, 1))  # 20 rows: a multiple of 4 and of 5 numbers
    if columns == 5:
        rows[:, 4] = np.arange(20)
    file = tmp_path / "cloud.bin"
    file.write_bytes(rows.astype("<f4").tobytes())
    ring = read_cloud(file).ring
    assert (None if ring is None else ring.tolist()) == (list(range(20)) if columns == 5 else None)
    assert read_cloud(file).points.tolist() == np.tile(XYZ, (5, 1)).tolist()


@pytest.mark.parametrize("columns", [4, 5])
def test_where_both_fit_the_columns_are_those_that_do_not_mix(tmp_path: Path, columns: int) -> None:
    rng = np.random.default_rng(0)
    rows = np.column_stack([*rng.normal(0, [[9], [7], [1]], (3, 200)), *rng.random((2, 200))])
    rows = rows[:, :columns]  # the fifth is a time: 800 or 1000 numbers, no rings
    file = tmp_path / "cloud.bin"
    file.write_bytes(rows.astype("<f4").tobytes())
    assert read_cloud(file).points.tolist() == rows[:, :3].astype(np.float32).tolist()


def test_an_npy_may_be_of_any_number_type_organised_or_named(tmp_path: Path) -> None:
    named = np.zeros(4, dtype=[("z", "f8"), ("x", "f4"), ("y", "f4")])
    for name, column in zip("xyz", XYZ.T, strict=True):
        named[name] = column
    for array in (XYZ, with_columns(6).astype(np.float64), XYZ.reshape(2, 2, 3), named):
        np.save(tmp_path / "cloud.npy", array)
        assert read_cloud(tmp_path / "cloud.npy").points.tolist() == XYZ.tolist()


def pcd(kind: str, body: bytes, header: str = FIELDS + "POINTS 4\n") -> bytes:
    return f"# a comment\nVERSION 0.7\n{header}DATA {kind}\n".encode() + body


def literal(data: bytes) -> bytes:
    pieces = [data[i : i + 32] for i in range(0, len(data), 32)]
    return b"".join(bytes([len(p) - 1]) + p for p in pieces)


def test_a_pcd_may_be_ascii_binary_or_compressed(tmp_path: Path) -> None:
    rows = with_columns(4).astype("<f4")
    text = "\n".join(" ".join(str(v) for v in row) for row in rows).encode()
    packed = literal(rows.T.tobytes())
    sizes = np.array([len(packed), rows.nbytes], "<u4").tobytes()
    bodies = {"ascii": text, "binary": rows.tobytes(), "binary_compressed": sizes + packed}
    for kind, body in bodies.items():
        (tmp_path / "cloud.pcd").write_bytes(pcd(kind, body))
        assert read_cloud(tmp_path / "cloud.pcd").points.tolist() == XYZ.tolist(), kind


def test_pcd_padding_and_counts_are_skipped(tmp_path: Path) -> None:
    header = (
        "FIELDS x _ y z _\nSIZE 4 1 4 8 2\nTYPE F U F F U\nCOUNT 1 4 1 1 3\nWIDTH 4\nHEIGHT 1\n"
    )
    dtype = np.dtype([("x", "<f4"), ("a", "u1", 4), ("y", "<f4"), ("z", "<f8"), ("b", "<u2", 3)])
    rows = np.ones(4, dtype)
    for name, column in zip("xyz", XYZ.T, strict=True):
        rows[name] = column
    (tmp_path / "cloud.pcd").write_bytes(pcd("binary", rows.tobytes(), header))
    assert read_cloud(tmp_path / "cloud.pcd").points.tolist() == XYZ.tolist()


def test_rings_are_read_where_a_field_tells_them(tmp_path: Path) -> None:
    rows = np.zeros(4, dtype=[("x", "f8"), ("y", "f8"), ("z", "f8"), ("t", "u4"), ("ring", "u2")])
    for name, column in zip("xyz", XYZ.T, strict=True):
        rows[name] = column
    rows["ring"] = [3, 1, 0, 31]
    np.save(tmp_path / "cloud.npy", rows)
    header = "FIELDS x y z t ring\nSIZE 8 8 8 4 2\nTYPE F F F U U\nWIDTH 4\nHEIGHT 1\n"
    (tmp_path / "cloud.pcd").write_bytes(pcd("binary", rows.tobytes(), header))
    for file in ("cloud.npy", "cloud.pcd"):
        points, ring = read_cloud(tmp_path / file)
        assert points.tolist() == XYZ.tolist()
        assert ring is not None
        assert ring.tolist() == [3, 1, 0, 31]


def test_rings_that_cannot_be_are_none(tmp_path: Path) -> None:
    rows = np.zeros(2, dtype=[("x", "f4"), ("y", "f4"), ("z", "f4"), ("ring", "f4")])
    rows["ring"] = [0.5, np.nan]
    np.save(tmp_path / "cloud.npy", rows)
    assert read_cloud(tmp_path / "cloud.npy").ring is None


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.txt", b"", "'.txt' is not one of '.bin', '.npy', '.pcd'"),
        ("a.bin", b"12345", "no float32"),
        ("a.bin", b"\0" * 12, "no rows of 4 or of 5"),
        ("a.npy", b"hello", "not an npy"),
        ("a.pcd", b"hello", "no DATA"),
        ("a.pcd", b"DATA binary\n", "header: no FIELDS line"),
        ("a.pcd", pcd("binary", b"", FIELDS.replace("TYPE", "TIPE")), "no TYPE line"),
        (
            "a.pcd",
            pcd("binary", b"", "FIELDS x\nSIZE 3\nTYPE F\nWIDTH 0\nHEIGHT 1\n"),
            "TYPE and SIZE of field 'x': 'F 3' is not one of 'F 2', 'F 4', 'F 8', 'I 1'",
        ),
        ("a.pcd", pcd("morse", b""), "'morse' is not one of"),
        ("a.pcd", pcd("binary", b"123"), "3 bytes, not 4 points of 16"),
        ("a.pcd", pcd("ascii", b"1 2 3"), "3 numbers, not 4 rows of 4"),
        ("a.pcd", pcd("ascii", b"x " * 16), "could not convert"),
        ("a.pcd", pcd("binary_compressed", b"123"), "no sizes"),
        ("a.pcd", pcd("binary", b"", FIELDS.replace("x", "q") + "POINTS 0\n"), "no field 'x'"),
        ("a.pcd", pcd("binary", b"", FIELDS + "POINTS -1\n"), "-1 points"),
    ],
)
def test_a_file_that_is_not_what_it_says_is_refused(
    tmp_path: Path, name: str, data: bytes, words: str
) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(MessageError, match=words):
        read_cloud(tmp_path / name)


def test_an_npy_without_three_columns_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.zeros((5, 2)))
    with pytest.raises(MessageError, match=r"\(5, 2\) holds no x, y, z"):
        read_cloud(tmp_path / "a.npy")


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MessageError, match="No such file"):
        read_cloud(tmp_path / "none.bin")


def test_lzf_copies_may_overlap_and_be_long() -> None:
    # "ab", then 2 + 7 + 3 bytes from 2 back: the copy reads what it writes.
    assert decompress(b"\x01ab\xe0\x03\x01", 14) == b"ab" * 7


@pytest.mark.parametrize("data", [b"\x05ab", b"\xe0", b"\x20\x05", b"\x01ab"])
def test_broken_lzf_is_refused(data: bytes) -> None:
    with pytest.raises(MessageError, match="LZF"):
        decompress(data, 9)


def npy_header(description: str) -> bytes:
    text = f"{description}".ljust(117).encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


@pytest.mark.parametrize(
    "data",
    [
        npy_header("{'descr': '<f4', 'fortran_order': False, 'shape': (02,)}"),
        npy_header("{'descr': '<02f4', 'fortran_order': False, 'shape': (2,)}"),
        npy_header("{b'descr': '<f4', 'fortran_order': False, 'shape': (2, 3)}"),
        npy_header("{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999, 3)}"),
        npy_header("{'descr': [('x', '<f4', (0,)), ('y', '<f4'), ('z', '<f4')],"
                   " 'fortran_order': False, 'shape': (0,)}"),
        npy_header("{'descr': '<f4"),
    ],
)  # fmt: skip
def test_an_npy_with_a_broken_header_is_refused(tmp_path: Path, data: bytes) -> None:
    file = tmp_path / "cloud.npy"
    file.write_bytes(data)
    with pytest.raises(MessageError):
        read_cloud(file)


def test_numbers_that_are_none_make_no_warning(tmp_path: Path) -> None:
    file = tmp_path / "cloud.bin"
    file.write_bytes(np.arange(0x7F800000, 0x7F800000 + 40, dtype="<u4").tobytes())
    assert len(read_cloud(file).points) in (8, 10)  # infinity and signalling NaNs
