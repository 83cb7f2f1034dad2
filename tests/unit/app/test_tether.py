import subprocess
import sys

TETHERED = """
import sys, threading
from twinscrew.runtime.app.tether import at_end_of_input
ended = threading.Event()
at_end_of_input(ended.set)
print("waits" if not ended.wait(0.2) else "ended", flush=True)
print("ended" if ended.wait(60) else "waits", flush=True)
"""


def test_it_tells_when_the_other_end_of_the_input_closes_and_not_before():
    with subprocess.Popen(
        [sys.executable, "-c", TETHERED],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write("what is said there means nothing\n")
        process.stdin.flush()
        assert process.stdout.readline() == "waits\n"
        process.stdin.close()
        assert process.stdout.readline() == "ended\n"


def test_without_an_input_it_tells_at_once():
    said = subprocess.run(
        ["bash", "-c", 'exec "$0" -c "$1" <&-', sys.executable, TETHERED],
        capture_output=True,
        text=True,
        check=True,
    )
    assert said.stdout.split() == ["ended", "ended"]
