import json
import os
import subprocess
import sys

import pytest

from twinscrew.runtime.vessel.one_thread import VARIABLES

LOOK = """
import json, os
import twinscrew.runtime.cli.run
import numpy as np
a = np.ones((400, 400))
for _ in range(20):
    a @ a
print(json.dumps([os.environ["OPENBLAS_NUM_THREADS"], len(os.listdir("/proc/self/task"))]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("wanted", [None, "2"])
def test_the_boats_command_has_one_numerical_thread_unless_told_otherwise(wanted) -> None:
    environment = {k: v for k, v in os.environ.items() if k not in VARIABLES}
    if wanted is not None:
        environment |= dict.fromkeys(VARIABLES, wanted)
    done = subprocess.run(
        [sys.executable, "-c", LOOK], capture_output=True, text=True, check=True, env=environment
    )
    said, threads = json.loads(done.stdout)
    assert said == (wanted or "1")
    if wanted is None:
        assert threads == 1
