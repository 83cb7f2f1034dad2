"""The short way to filterpy and scipy gives the real things, and quickly."""

import json
import subprocess
import sys

import numpy as np
import pytest

SHORT = """
import json, sys
from twinscrew.runtime import lean_imports as light
filter_, assign = light.kalman_filter(), light.linear_sum_assignment()
kf = filter_(dim_x=2, dim_z=1)
kf.F[0, 1] = kf.H[0, 0] = 1.0
kf.predict(); kf.update(3.0)
heavy = [name for name in sys.modules if name.split(".")[0] in ("filterpy", "scipy")]
likelihood = kf.log_likelihood
full = __import__("filterpy.kalman").kalman.KalmanFilter(dim_x=2, dim_z=1)
print(json.dumps({
    "x": kf.x.tolist(),
    "likelihood": float(likelihood),
    "pairs": [part.tolist() for part in assign([[4, 1, 3], [2, 0, 5], [3, 2, 2]])],
    "heavy": heavy,
    "full": type(full).__module__,
}))
"""


def run(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@pytest.mark.slow
def test_the_short_way_is_the_same_filter_and_assignment():
    from filterpy.kalman import KalmanFilter
    from scipy.optimize import linear_sum_assignment

    kf = KalmanFilter(dim_x=2, dim_z=1)
    kf.F[0, 1] = kf.H[0, 0] = 1.0
    kf.predict()
    kf.update(3.0)
    short = run(SHORT)
    assert short["x"] == kf.x.tolist()
    assert np.isclose(short["likelihood"], kf.log_likelihood)
    pairs = linear_sum_assignment([[4, 1, 3], [2, 0, 5], [3, 2, 2]])
    assert short["pairs"] == [part.tolist() for part in pairs]


@pytest.mark.slow
def test_the_short_way_leaves_nothing_behind_and_the_whole_package_can_follow():
    short = run(SHORT)
    assert short["heavy"] == []
    assert short["full"] == "filterpy.kalman.kalman_filter"


@pytest.mark.slow
def test_what_is_imported_already_is_used():
    code = """
import json
import filterpy.kalman, scipy.optimize
from twinscrew.runtime import lean_imports as light
print(json.dumps([
    light.kalman_filter() is filterpy.kalman.KalmanFilter,
    light.linear_sum_assignment() is scipy.optimize.linear_sum_assignment,
]))
"""
    assert run(code) == [True, True]


@pytest.mark.slow
def test_a_package_laid_out_differently_is_imported_as_usual():
    code = """
import json
from twinscrew.runtime import lean_imports as light
light._search = lambda parents, name: (_ for _ in ()).throw(ImportError(name))
import filterpy.kalman.kalman_filter as whole, sys
whole, KalmanFilter = None, None
for name in [n for n in sys.modules if n.split(".")[0] == "filterpy"]:
    del sys.modules[name]
filter_, assign = light.kalman_filter(), light.linear_sum_assignment()
import filterpy.kalman, scipy.optimize
print(json.dumps([
    filter_ is filterpy.kalman.KalmanFilter, assign is scipy.optimize.linear_sum_assignment
]))
"""
    assert run(code) == [True, True]


@pytest.mark.slow
def test_the_extended_filter_comes_the_same_way():
    code = """
import inspect, json
from twinscrew.runtime import lean_imports as light
short, again = light.extended_kalman_filter(), light.extended_kalman_filter()
from filterpy.kalman import ExtendedKalmanFilter
same = inspect.getsource(short) == inspect.getsource(ExtendedKalmanFilter)
print(json.dumps({"same": same, "once": short is again}))
"""
    assert run(code) == {"same": True, "once": True}
