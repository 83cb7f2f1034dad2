// What both bindings ask of numpy arrays: their types, and the checks before the core sees them.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace twinscrew {

/// A contiguous array in this machine's memory; -1 is an axis of any length.
template <typename T, nanobind::ssize_t... shape>
using Array = nanobind::ndarray<T, nanobind::numpy, nanobind::shape<shape...>,
                                nanobind::c_contig, nanobind::device::cpu>;
template <nanobind::ssize_t... shape>
using In = Array<const double, shape...>;
template <nanobind::ssize_t... shape>
using Out = Array<double, shape...>;

/// Raises a ValueError in Python.
inline void require(bool condition, const char* message) {
  if (!condition) throw std::invalid_argument(message);
}

template <typename A>
bool finite(const A& a) {
  return std::all_of(a.data(), a.data() + a.size(), [](double x) { return std::isfinite(x); });
}

}  // namespace twinscrew
