// Where a scan has shown the water to be free: what tells whether long objects move. The same in
// plain numpy: tests/reference/free_water.py.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

namespace twinscrew {

class FreeWater {
 public:
  // sights: (A, 2) where each sector's sight ends [m], levelled frame B; from: where they begin.
  // Where nothing is looked at, as beside an image that is no full turn, no water is free; nor is it
  // within `guard` [rad] of a sight that ends before.
  FreeWater(std::span<const double> sights, double from_x, double from_y, double sector,
            double guard, bool is_closed)
      : x_(from_x),
        y_(from_y),
        free_(static_cast<std::size_t>(std::ceil(TURN / sector)), UNSEEN),
        per_rad_(static_cast<double>(free_.size()) / TURN) {
    const std::size_t count = sights.size() / 2;
    for (std::size_t i = 0; i < count; ++i) {
      const double dx = sights[2 * i] - x_, dy = sights[2 * i + 1] - y_;
      const bool is_edge = !is_closed && (i == 0 || i + 1 == count);
      double& free = free_[bin(dx, dy)];
      free = std::min(free, is_edge ? 0.0 : std::hypot(dx, dy));
    }
    narrow(static_cast<std::size_t>(std::ceil(guard * per_rad_)));
  }

  // Is a place in free water, and further from its end than the margin [m]?
  bool holds(double x, double y, double margin) const {
    const double dx = x - x_, dy = y - y_;
    return std::hypot(dx, dy) < free_[bin(dx, dy)] - margin;
  }

 private:
  static constexpr double TURN = 2.0 * std::numbers::pi;
  static constexpr double UNSEEN = std::numeric_limits<double>::infinity();

  std::size_t bin(double dx, double dy) const {
    const double real = (std::atan2(dy, dx) + std::numbers::pi) * per_rad_;
    return real > 0.0 ? std::min(static_cast<std::size_t>(real), free_.size() - 1) : 0;
  }

  // Leaves in each bin the least of those around it, so many to either side; 0 where none was seen.
  void narrow(std::size_t guard) {
    const std::size_t size = free_.size();
    guard = std::min(guard, size / 2);
    const std::vector<double> seen = free_;
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t k = 1; k <= guard; ++k) {
        free_[i] = std::min({free_[i], seen[(i + k) % size], seen[(i + size - k) % size]});
      }
      if (free_[i] == UNSEEN) free_[i] = 0.0;
    }
  }

  double x_, y_;  // [m]
  std::vector<double> free_;  // [m] of each bin of azimuth, from -pi on
  double per_rad_;
};

}  // namespace twinscrew
