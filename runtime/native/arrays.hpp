// What the bindings ask of numpy arrays, and how they give them.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <stdexcept>

namespace twinscrew {

/// A contiguous array in this machine's memory; -1 is an axis of any length.
template <typename T, nanobind::ssize_t... shape>
using Array =
    nanobind::ndarray<T, nanobind::shape<shape...>, nanobind::c_contig, nanobind::device::cpu>;
template <nanobind::ssize_t... shape>
using In = Array<const double, shape...>;
template <typename T>
using Given = nanobind::ndarray<nanobind::numpy, T>;

/// Raises a ValueError in Python.
inline void require(bool condition, const char* message) {
  if (!condition) throw std::invalid_argument(message);
}

/// An array of its own memory, filled by `fill(pointer)`.
template <class T, class Fill>
Given<T> make_array(std::initializer_list<std::size_t> shape, Fill fill) {
  std::size_t size = 1;
  for (const std::size_t n : shape) size *= n;
  auto memory = std::make_unique<T[]>(std::max<std::size_t>(size, 1));
  fill(memory.get());
  T* raw = memory.release();
  const nanobind::capsule owner(raw, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  return Given<T>(raw, shape, owner);
}

}  // namespace twinscrew
