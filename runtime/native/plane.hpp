// The horizontal plane around the vessel, divided into small squares.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

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
};

}  // namespace twinscrew
