import resource
from pathlib import Path

import pytest
from msgspec.structs import replace
from tests.unit.experiments.episodes import TIMING, encounter, episode, vessel

from twinscrew.hil_sim.experiments.results import (
    RESULTS_FILE,
    ResultsFile,
    read_results,
    results_sha256,
)
from twinscrew.runtime.errors import RecordingError


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / RESULTS_FILE


def write(path: Path, count: int) -> list:
    with ResultsFile(path) as file:
        for number in range(len(file.records), count):
            file.append(episode(number, encounters=(encounter(),)))
        return list(file.records)


def test_what_is_appended_is_read_again_as_it_was(path: Path) -> None:
    odd = vessel("collision", touched="buoy", near=None)
    with ResultsFile(path) as file:
        file.append(episode(0, encounters=(encounter(),)))
        file.append(episode(1, vessels=(odd,), cause="buoy"))
        kept = list(file.records)
    assert read_results(path) == kept
    assert kept[1].vessels == (odd,)


def test_an_episode_is_in_the_file_before_append_returns(path: Path) -> None:
    with ResultsFile(path) as file:
        file.append(episode(0))
        assert read_results(path) == [episode(0)]


@pytest.mark.parametrize("cut", [1, 10, 200])
def test_a_half_written_last_line_is_no_episode_and_is_overwritten(path: Path, cut: int) -> None:
    write(path, 3)
    whole = path.read_bytes()
    path.write_bytes(whole[:-cut])
    assert len(read_results(path)) == 2
    write(path, 3)
    assert path.read_bytes() == whole


@pytest.mark.parametrize(
    "line",
    [b'{"method": 3}', b'{"method": "\xff"}', pytest.param(b'{"x": ' + b"[" * 100_000, id="deep")],
)
def test_a_damaged_line_is_named(path: Path, line: bytes) -> None:
    write(path, 3)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + line + b"\n" + lines[2])
    with pytest.raises(RecordingError, match=rf"{RESULTS_FILE}:2: not an episode"):
        read_results(path)


def test_an_episode_that_is_there_twice_is_refused(path: Path) -> None:
    write(path, 2)
    path.write_bytes(path.read_bytes() + path.read_bytes().splitlines(keepends=True)[0])
    with pytest.raises(RecordingError, match=rf"{RESULTS_FILE}:3: line 1 again"):
        read_results(path)


def test_two_experiments_cannot_write_into_one_file(path: Path) -> None:
    refused = pytest.raises(RecordingError, match="another experiment writes into it")
    with ResultsFile(path), refused, ResultsFile(path):
        pass
    write(path, 1)  # afterwards it is free again


def test_a_disk_that_fills_loses_nothing_but_the_episode_that_did_not_fit(path: Path) -> None:
    before = write(path, 3)
    whole = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(whole) + 100, limits[1]))
        with pytest.raises(RecordingError, match=r"3 episodes are kept.*--resume"):
            write(path, 4)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == whole
    assert write(path, 4)[:3] == before


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with (
        pytest.raises(RecordingError, match="No such file"),
        ResultsFile(tmp_path / "x" / RESULTS_FILE),
    ):
        pass


def test_the_hash_knows_neither_order_nor_clock() -> None:
    slow = replace(TIMING, wall_s=99.0, decision_max_ms=50.0)
    records = [episode(0), episode(1), episode(2)]
    again = [episode(2, timing=slow), episode(0), episode(1, timing=slow)]
    assert results_sha256(records) == results_sha256(again)


def test_the_hash_knows_every_result() -> None:
    one = results_sha256([episode(0)])
    assert one != results_sha256([episode(0, decisions_sha256="1" * 64)])
    assert one != results_sha256([episode(0, vessels=(vessel(travel_time_s=20.001), vessel()))])
    assert one != results_sha256([episode(0), episode(1)])
