"""Point cloud files of others: KITTI and nuScenes .bin, PCD, npy; axes x forward, y left, z up.

PCD files are read here and not by pypcd4, which refuses headers without COUNT or POINTS lines and
takes files that end early.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import MessageError, one_of
from twinscrew.runtime.messages.types import Float32

RINGS = 256
"""[-] No LiDAR has more beams: tells nuScenes's ring column from anything else."""
RING_FIELDS = ("ring", "channel")
PCD_NUMBERS = {
    (kind, size): f"<{kind.lower()}{size}"
    for kind, sizes in {"F": "248", "I": "1248", "U": "1248"}.items()
    for size in sizes
}
"""By TYPE and SIZE: what numbers a PCD holds."""


class FilePoints(NamedTuple):
    """What a file tells of its points."""

    points: Float32
    """[m] (N, 3) in the file's own axes."""
    ring: NDArray[np.uint16] | None = None
    """[-] (N,) Each point's beam."""


def read_cloud(path: Path) -> FilePoints:
    """Read a cloud.

    Raises
    ------
    MessageError
        The file cannot be read, or is not what its name says.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise MessageError(f"{path}: suffix {one_of(path.suffix, READERS)}")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MessageError(f"{path}: {error.strerror or error}") from error
    try:
        return reader(data)
    except MessageError as error:
        raise MessageError(f"{path}: {error}") from error


def read_bin(data: bytes) -> FilePoints:
    """Read rows of 4 (KITTI: x y z intensity) or 5 (nuScenes: .. and ring) float32."""
    if len(data) % 4:
        raise MessageError(f"{len(data)} bytes are no float32 numbers")
    values = np.frombuffer(data, "<f4")
    fits = [columns for columns in (4, 5) if values.size % columns == 0]
    if not fits:
        raise MessageError(f"{values.size} numbers are no rows of 4 or of 5")
    ring = _rings(values[4::5]) if 5 in fits else None
    columns = 5 if ring is not None else min(fits, key=lambda count: _mixture(values, count))
    return FilePoints(np.ascontiguousarray(values.reshape(-1, columns)[:, :3]), ring)


def _mixture(values: Float32, columns: int) -> float:
    """Give the mean logarithm of the columns' variances: too many or too few columns mix them."""
    with np.errstate(over="ignore", invalid="ignore"):
        rows = np.clip(np.nan_to_num(values), -1e6, 1e6).reshape(-1, columns).astype(np.float64)
    return float(np.log(rows.var(axis=0) + 1e-12).mean()) if len(rows) else 0.0


def read_npy(data: bytes) -> FilePoints:
    """Read an array (.., 3 or more) of x, y, z, or one with fields of these names."""
    import io

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy warns of headers that it guesses at
            array = np.load(io.BytesIO(data), allow_pickle=False)
    except Exception as error:  # a broken header is evaluated, and may fail in any way
        raise MessageError(f"not an npy array of numbers: {error}") from error
    if not isinstance(array, np.ndarray):
        raise MessageError("several arrays (npz); one array is needed")
    if array.dtype.names is not None:
        return _columns(array.reshape(-1))
    if array.dtype.kind not in "fiu" or array.ndim < 2 or array.shape[-1] < 3:
        raise MessageError(f"{array.dtype} array of shape {array.shape} holds no x, y, z")
    with np.errstate(over="ignore"):
        rows = array.reshape(-1, array.shape[-1])[:, :3]
        return FilePoints(np.ascontiguousarray(rows, np.float32))


def read_pcd(data: bytes) -> FilePoints:
    """Read a PCD: ascii, binary or binary_compressed."""
    header, body = _pcd_header(data)
    try:
        dtype = _pcd_dtype(header)
        count = int(header["POINTS"][0]) if "POINTS" in header else _size(header)
        kind = header["DATA"][0].lower()
    except KeyError as error:
        raise MessageError(f"PCD header: no {error.args[0]} line") from error
    except (IndexError, ValueError, TypeError) as error:
        raise MessageError(f"PCD header: {error}") from error
    if kind not in PCD_BODIES:
        raise MessageError(f"PCD: DATA {one_of(kind, PCD_BODIES)}")
    if count < 0:
        raise MessageError(f"PCD: {count} points")
    return _columns(PCD_BODIES[kind](body, dtype, count))


def _columns(points: NDArray[Any]) -> FilePoints:
    """Give x, y, z and perhaps the ring of a structured array."""
    names = points.dtype.names or ()
    missing = [name for name in "xyz" if name not in names]
    if missing:
        raise MessageError(f"no field {missing[0]!r}, only {', '.join(names)}")
    if any(points.dtype[name].base.kind not in "fiu" for name in "xyz"):
        raise MessageError("fields x, y, z are not numbers")
    with np.errstate(over="ignore"):
        xyz = np.stack([_column(points, name) for name in "xyz"], axis=1).astype(np.float32)
    ring = next((points[name].reshape(-1) for name in RING_FIELDS if name in names), None)
    usable = ring is not None and ring.dtype.kind in "fiu" and len(ring) == len(xyz)
    return FilePoints(xyz, _rings(ring) if usable and ring is not None else None)


def _column(points: NDArray[Any], name: str) -> NDArray[Any]:
    """Give a field's value of each point; the first if it has several."""
    values = points[name]
    if 0 in values.shape[1:]:
        raise MessageError(f"field {name!r} has no values")
    first: tuple[Any, ...] = (slice(None), *[0] * (values.ndim - 1))
    column: NDArray[Any] = values[first]
    return column


def _rings(values: NDArray[Any]) -> NDArray[np.uint16] | None:
    """Give numbers as rings; none if they cannot be."""
    with np.errstate(invalid="ignore"):
        whole = (values >= 0) & (values < RINGS) & (values == np.trunc(values))
    return values.astype(np.uint16) if whole.all() else None


def _pcd_header(data: bytes) -> tuple[dict[str, list[str]], bytes]:
    header: dict[str, list[str]] = {}
    at = 0
    while at < len(data):
        end = data.find(b"\n", at)
        end = len(data) if end < 0 else end
        words = data[at:end].decode("ascii", "replace").split()
        at = end + 1
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
            if words[0].upper() == "DATA":
                return header, data[at:]
    raise MessageError("not a PCD: no DATA line")


def _size(header: dict[str, list[str]]) -> int:
    return int(header["WIDTH"][0]) * int(header["HEIGHT"][0])


def _pcd_dtype(header: dict[str, list[str]]) -> np.dtype[Any]:
    names = header["FIELDS"]
    counts = [int(c) for c in header.get("COUNT", ["1"] * len(names))]
    if min(counts, default=0) < 1:
        raise ValueError("COUNT must be at least 1")
    fields, known = [], {"_"}  # padding repeats
    for i, (name, size, kind, count) in enumerate(
        zip(names, header["SIZE"], header["TYPE"], counts, strict=True)
    ):
        number = (kind.upper(), size)
        if number not in PCD_NUMBERS:
            said = one_of(" ".join(number), map(" ".join, PCD_NUMBERS))
            raise MessageError(f"PCD: TYPE and SIZE of field {name!r}: {said}")
        fields.append((f"_ {i}" if name in known else name, PCD_NUMBERS[number], (count,)))
        known.add(name)
    return np.dtype(fields)


def _ascii(body: bytes, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
    width = sum(int(np.prod(dtype[name].shape)) for name in dtype.names or ())
    words = body.split()
    if len(words) != width * count:
        raise MessageError(f"PCD: {len(words)} numbers, not {count} rows of {width}")
    try:
        table = np.array(words, dtype=np.float64).reshape(count, width)
    except ValueError as error:
        raise MessageError(f"PCD: {error}") from error
    points, at = np.zeros(count, dtype=[(n, "<f8") for n in dtype.names or ()]), 0
    for name in dtype.names or ():
        points[name] = table[:, at] if count else 0.0
        at += int(np.prod(dtype[name].shape))
    return points


def _binary(body: bytes, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
    if len(body) < count * dtype.itemsize:
        raise MessageError(f"PCD: {len(body)} bytes, not {count} points of {dtype.itemsize}")
    return np.frombuffer(body, dtype, count)


def _compressed(body: bytes, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
    """Uncompress; the fields lie one after another, each with all its points."""
    if len(body) < 8:
        raise MessageError("PCD: no sizes before the compressed points")
    packed, size = (int(n) for n in np.frombuffer(body, "<u4", 2))
    if size != count * dtype.itemsize or len(body) < 8 + packed:
        raise MessageError(f"PCD: {size} bytes uncompressed, not {count} of {dtype.itemsize}")
    data = decompress(body[8 : 8 + packed], size)
    points, at = np.zeros(count, dtype), 0
    for name in dtype.names or ():
        field = dtype[name]
        values = np.frombuffer(data, field.base, count * int(np.prod(field.shape)), at)
        points[name] = values.reshape(count, *field.shape)
        at += count * field.itemsize
    return points


READERS: dict[str, Callable[[bytes], FilePoints]] = {
    ".bin": read_bin,
    ".npy": read_npy,
    ".pcd": read_pcd,
}
PCD_BODIES: dict[str, Callable[[bytes, np.dtype[Any], int], NDArray[Any]]] = {
    "ascii": _ascii,
    "binary": _binary,
    "binary_compressed": _compressed,
}


# LZF decompression, for PCD's binary_compressed. A control byte below 32 is followed by one byte
# more than it says, to be copied. Any other repeats output: its upper 3 bits are the length less 2
# (7: the next byte is added), its lower 5 bits and one more byte the distance back less 1.

LITERAL = 32


def decompress(data: bytes, size: int) -> bytes:
    """Give the `size` bytes that `data` holds.

    Raises
    ------
    MessageError
        The data end early, reach back before their beginning, or hold another number of bytes.
    """
    out, at = bytearray(), 0
    try:
        while at < len(data) and len(out) <= size:
            control = data[at]
            at += 1
            if control < LITERAL:
                out += data[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += data[at]
                at += 1
            start = len(out) - ((control & 31) << 8) - data[at] - 1
            at += 1
            _copy(out, start, length + 2)
    except IndexError as error:
        raise MessageError("LZF: the data end early") from error
    if len(out) != size or at > len(data):
        raise MessageError(f"LZF: {len(out)} bytes, not {size}")
    return bytes(out)


def _copy(out: bytearray, start: int, length: int) -> None:
    """Repeat what was written from `start`; the copy may overlap itself."""
    if start < 0:
        raise MessageError("LZF: a copy from before the beginning")
    while length > 0:
        piece = out[start : start + length]
        out += piece
        length -= len(piece)
