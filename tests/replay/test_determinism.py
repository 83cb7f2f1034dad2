"""The same recording gives the same decisions, to the last bit, whatever the machine is doing."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from tests.replay.references import CASES, decide, inputs, sha256

from twinscrew.runtime.messages import cdr

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
MANY_THREADS = {"OMP_NUM_THREADS": "4", "OPENBLAS_NUM_THREADS": "4", "MKL_NUM_THREADS": "4"}

AT_NIGHT = [pytest.param(case, marks=pytest.mark.nightly) for case in ("apf", "assured")]


@pytest.fixture(scope="module")
def expected() -> dict[str, str]:
    return {case: sha256(decide(case)) for case in CASES}


def elsewhere(
    case: str,
    environment: dict[str, str] | None = None,
    *,
    cores: int | None = None,
    threads: int | None = None,
) -> str:
    """The hash from a process of its own."""
    allowed = sorted(os.sched_getaffinity(0))
    # taskset, so that the process is confined before its libraries count the cores
    pin = [] if cores is None else ["taskset", "-c", ",".join(map(str, allowed[:cores]))]
    command = [*pin, sys.executable, "-m", "tests.replay.decide", case]
    command += [] if threads is None else [str(threads)]
    done = subprocess.run(
        command,
        env={**os.environ, **ONE_THREAD, **(environment or {})},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@contextmanager
def busy_machine(processes: int) -> Iterator[None]:
    """Let others compute, and fight for the caches, meanwhile."""
    work = (
        "import numpy as np\nx = np.random.rand(600, 600)\nwhile True: x = np.tanh(x @ x.T / 600)"
    )
    others = [subprocess.Popen([sys.executable, "-c", work]) for _ in range(processes)]
    try:
        time.sleep(0.3)
        assert all(other.poll() is None for other in others)
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


@pytest.mark.parametrize("case", CASES)
def test_repeated_in_this_process(case: str, expected: dict[str, str]) -> None:
    assert {sha256(decide(case)) for _ in range(3)} == {expected[case]}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_in_another_process(case: str, expected: dict[str, str]) -> None:
    assert elsewhere(case) == expected[case]


@pytest.mark.slow
@pytest.mark.parametrize("seed", ["0", "12345"])
def test_whatever_seed_python_hashes_with(seed: str, expected: dict[str, str]) -> None:
    assert elsewhere("ac_iqn", {"PYTHONHASHSEED": seed}) == expected["ac_iqn"]


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("cores", [1, 2])
def test_on_one_core_and_on_two(case: str, cores: int, expected: dict[str, str]) -> None:
    assert elsewhere(case, MANY_THREADS, cores=cores) == expected[case]


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    ["ac_iqn", *(pytest.param(one, marks=pytest.mark.nightly) for one in ("apf", "assured"))],
)
def test_while_the_machine_is_busy(case: str, expected: dict[str, str]) -> None:
    with busy_machine(processes=3):
        assert elsewhere(case) == expected[case]


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_with_other_numbers_of_threads_in_the_numerical_libraries(
    case: str, expected: dict[str, str]
) -> None:
    assert elsewhere(case, MANY_THREADS, threads=4) == expected[case]


def test_the_hash_would_notice_the_last_bit() -> None:
    decisions = decide("apf")
    last = bytearray(decisions[-1])
    last[-1] ^= 1
    assert sha256((*decisions[:-1], bytes(last))) != sha256(decisions)


def test_the_recording_is_worth_replaying() -> None:
    """It holds what makes decisions: scans, another vessel under way, an intervention."""
    counts: dict[str, int] = {}
    for message in inputs().inputs():
        counts[message.topic] = counts.get(message.topic, 0) + 1
    assert counts["points"] >= 30
    assert counts["odometry"] >= 60
    others: dict[str, int] = {}
    for message in inputs(case="senses").inputs():
        others[message.topic] = others.get(message.topic, 0) + 1
    assert others["nmea"] >= 3
    assert others["radar"] >= 3
    with_ship = [cdr.decode_decision(payload) for payload in decide("senses")]
    (alarm,) = {e.detail[:9] for d in with_ship for e in d.events if e.name == "collision_course"}
    assert alarm == "257000001"
    decisions = [cdr.decode_decision(payload) for payload in decide("assured")]
    assert any((abs(decision.tracks.v_N) > 1.0).any() for decision in decisions)
    assert any(event.name == "assurance_intervened" for d in decisions for event in d.events)
    assert any(decision.thrust.any() for decision in decisions)
