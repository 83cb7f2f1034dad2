// The horizontal plane around the vessel, divided into small squares.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "lanes.hpp"

namespace twinscrew {

// Squares of the levelled plane; one is named by its number along x times `side`, plus along y.
struct Plane {
  float per_metre;    // [squares/m]
  std::int32_t half;  // [squares] from the vessel's origin to each edge
  std::int32_t side;  // [squares]

  // reach [m]: how far from the origin an echo can be; farther ones count as on the edge.
  // Two squares to `gap` [m], but no more than 2047 squares a side.
  static Plane of(float reach, float gap) {
    const float per_metre = std::min(2.0F / gap, 1023.0F / reach);
    const auto half = static_cast<std::int32_t>(std::ceil(reach * per_metre));
    return {per_metre, half, 2 * half + 1};
  }

  Int4 square(Float4 x, Float4 y) const { return along(x) * side + along(y); }

 private:
  // Truncation of a shifted, positive number rounds down; NaN goes to an edge.
  Int4 along(Float4 metres) const {
    const auto limit = static_cast<float>(half);
    Float4 steps = metres * per_metre;
    steps = select(steps < limit, steps, all(limit));
    steps = select(steps > -limit, steps, all(-limit));
    return __builtin_convertvector(steps + limit, Int4);
  }
};

}  // namespace twinscrew
