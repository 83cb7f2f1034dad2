// What a scan has shown of places on the water: free, or something there, or nothing known. The
// same in plain numpy: tests/reference/free_water.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

namespace twinscrew {

// Whether some beam passes over a place low enough, but not so low that its echo would be taken for
// the water's. Heights [m] are over the vessel's origin, up; without beams nothing is overlooked.
struct Beams {
  static constexpr double FAR = 1e9;  // [m]

  std::vector<double> sines;     // of the elevations from the sensor's own level, rising
  std::array<double, 3> down{};  // the sensor's z axis, a unit vector
  double height = 0.0;           // of the sensor
  double least = 0.0;            // lower echoes are the water's

  bool meet(double dx, double dy, double top) const {
    if (sines.empty()) return true;
    const double ahead = down[0] * dx + down[1] * dy, away2 = dx * dx + dy * dy;
    // Of the elevation, from the sensor's level, of the line of sight to a height over the place.
    const auto sine = [&](double z) {
      const double rise = std::clamp(z - height, -FAR, FAR);
      return (down[2] * rise - ahead) / std::sqrt(away2 + rise * rise);
    };
    const auto beam = std::lower_bound(sines.begin(), sines.end(), sine(least));
    return beam != sines.end() && *beam <= sine(top);
  }
};

// Where the line of sight of one sector ends.
struct BoundaryEnd {
  double x, y;         // [m] where it ends
  bool is_echo;        // at an echo, or where nothing more is looked at
  std::int64_t object;  // whose echo that is
};

class FreeWater {
 public:
  enum Answer : std::int8_t { UNKNOWN, FREE, TAKEN };
  struct Known {
    Answer answer;
    std::int64_t object;  // what takes the place
  };

  // The lines of sight begin at x, y. Where nobody looks, as beside an image that is no full turn,
  // nothing is known; nor is it behind a sight within `guard` [rad] that ends before.
  FreeWater(std::span<const BoundaryEnd> boundary, double x, double y, double sector, double guard,
            bool is_closed, Beams beams)
      : x_(x),
        y_(y),
        bins_(static_cast<std::size_t>(std::ceil(TURN / std::max(sector, FINEST)))),
        per_rad_(static_cast<double>(bins_.size()) / TURN),
        beams_(std::move(beams)) {
    for (std::size_t i = 0; i < boundary.size(); ++i) {
      const double dx = boundary[i].x - x_, dy = boundary[i].y - y_;
      const bool is_edge = !is_closed && (i == 0 || i + 1 == boundary.size());
      const double reach = is_edge ? 0.0 : std::hypot(dx, dy);
      Bin& bin = bins_[index(dx, dy)];
      if (reach < bin.free) {
        bin = is_edge ? Bin{0.0, false, NOBODY} : Bin{reach, boundary[i].is_echo, boundary[i].object};
      }
    }
    narrow(static_cast<std::size_t>(std::ceil(guard * per_rad_)));
  }

  // What is known of a place where something reaches up to `top` [m], and a margin [m] around it?
  Known ask(double x, double y, double top, double margin) const {
    const double dx = x - x_, dy = y - y_, away = std::hypot(dx, dy);
    const Bin& bin = bins_[index(dx, dy)];
    if (away < bin.free - margin) return {beams_.meet(dx, dy, top) ? FREE : UNKNOWN, NOBODY};
    if (bin.is_echo && away <= bin.free + margin) return {TAKEN, bin.object};
    return {UNKNOWN, NOBODY};
  }

 private:
  static constexpr double TURN = 2.0 * std::numbers::pi;
  static constexpr double FINEST = 1e-4;  // [rad] a bin is no narrower, however fine columns are
  static constexpr std::int64_t NOBODY = -1;
  struct Bin {
    double free = std::numeric_limits<double>::infinity();  // [m]
    bool is_echo = false;
    std::int64_t object = NOBODY;
  };

  std::size_t index(double dx, double dy) const {
    const double real = (std::atan2(dy, dx) + std::numbers::pi) * per_rad_;
    return real > 0.0 ? std::min(static_cast<std::size_t>(real), bins_.size() - 1) : 0;
  }

  // Leaves in each bin the nearest of those around it, so many to either side.
  void narrow(std::size_t guard) {
    const std::size_t size = bins_.size();
    guard = std::min(guard, size / 2);
    const std::vector<Bin> seen = bins_;
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t k = 1; k <= guard; ++k) {
        for (const Bin& other : {seen[(i + k) % size], seen[(i + size - k) % size]}) {
          if (other.free < bins_[i].free) bins_[i] = other;
        }
      }
      if (std::isinf(bins_[i].free)) bins_[i] = {0.0, false, NOBODY};
    }
  }

  double x_, y_;  // [m]
  std::vector<Bin> bins_;  // of azimuth, from -pi on
  double per_rad_;
  Beams beams_;
};

}  // namespace twinscrew
