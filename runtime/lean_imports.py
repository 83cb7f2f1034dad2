"""filterpy's filter and scipy's assignment, without all that comes with them.

``import filterpy.kalman`` executes package files that pull in scipy.stats, scipy.ndimage and all
they need, and ``scipy.optimize`` pulls in every optimiser: half a second and more, for code that a
tracker never calls. Here the two files that hold the filter and the one extension module that holds
the assignment are executed alone, unchanged. If the installed versions are laid out differently,
the ordinary import does it.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import import_module
from importlib.machinery import PathFinder
from types import ModuleType
from typing import Any


def kalman_filter() -> Any:
    """Give the class `filterpy.kalman.KalmanFilter`."""
    return _of_filterpy("kalman_filter", "KalmanFilter")


def extended_kalman_filter() -> Any:
    """Give the class `filterpy.kalman.ExtendedKalmanFilter`."""
    return _of_filterpy("EKF", "ExtendedKalmanFilter")


@lru_cache
def _of_filterpy(module: str, name: str) -> Any:
    if "filterpy" not in sys.modules:
        try:
            with _bare_filterpy():
                return getattr(import_module(f"filterpy.kalman.{module}"), name)
        except (ImportError, AttributeError):
            pass
    return getattr(import_module("filterpy.kalman"), name)


def linear_sum_assignment() -> Any:
    """Give the function `scipy.optimize.linear_sum_assignment`."""
    if "scipy.optimize" not in sys.modules:
        try:
            folder = _search(_search(None, "scipy"), "scipy.optimize")
            spec = PathFinder.find_spec("_lsap", folder)
            if spec is not None and spec.loader is not None:
                module = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(module)
                return module.linear_sum_assignment
        except (ImportError, AttributeError):
            pass
    return import_module("scipy.optimize").linear_sum_assignment


@contextmanager
def _bare_filterpy() -> Iterator[None]:
    """Let modules of filterpy be imported without its package files; leave no trace of it."""
    before = set(sys.modules)
    try:
        root = _bare_package("filterpy", None)
        common = _bare_package("filterpy.common", root)
        _bare_package("filterpy.kalman", root)
        _add("filterpy.stats", logpdf=_logpdf)
        helpers = PathFinder.find_spec("filterpy.common.helpers", common)
        if helpers is None:
            raise ImportError("filterpy.common.helpers")
        module = import_module(helpers.name)
        _add("filterpy.common", pretty_str=module.pretty_str, reshape_z=module.reshape_z)
        yield
    finally:
        for name in set(sys.modules) - before:
            if name.partition(".")[0] == "filterpy":
                del sys.modules[name]


def _bare_package(name: str, parents: list[str] | None) -> list[str]:
    """Register a package of which no file is executed; give its folder."""
    folder = _search(parents, name)
    _add(name, __path__=folder)
    return folder


def _add(name: str, **attributes: Any) -> None:
    module = sys.modules.setdefault(name, ModuleType(name))
    vars(module).update(attributes)


def _search(parents: list[str] | None, name: str) -> list[str]:
    """Find a package's folder without importing it."""
    spec = PathFinder.find_spec(name, parents)
    if spec is None or spec.submodule_search_locations is None:
        raise ImportError(f"no package {name}")
    return list(spec.submodule_search_locations)


def _logpdf(*args: Any, **kwargs: Any) -> Any:
    """Stand in for filterpy.stats.logpdf until somebody asks a filter for a likelihood."""
    return import_module("filterpy.stats").logpdf(*args, **kwargs)
