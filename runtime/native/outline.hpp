// The outline: how far each sector's sight goes, whatever the row. Up to there the water is free.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "projection.hpp"
#include "range_image.hpp"
#include "scanner.hpp"

namespace twinscrew {

struct Sight {
  double x, y;       // [m] levelled frame B: the nearest echo, or the end of what is looked at
  std::int32_t seen;  // what `whose` says of the echo's cell, -1 where there is none
};

class Outline {
 public:
  // A sector is so many columns side by side; the last may have fewer. reach: [m].
  Outline(const Scanner& scanner, int sector, double reach) : sector_(sector), reach_(reach) {
    for (int first = 0; first < scanner.columns(); first += sector) {
      const int last = std::min(first + sector, scanner.columns()) - 1;
      const double azimuth = scanner.azimuth(0.5 * (first + last));
      rays_.push_back({std::cos(azimuth), std::sin(azimuth)});
    }
    nearest_.resize(rays_.size());
    sights_.resize(rays_.size());
  }

  // X_LS: from the sensor to the levelled frame B.
  template <class Whose>
  const std::vector<Sight>& operator()(const RangeImage& image, const Transform& X_LS,
                                       Whose whose) {
    find_nearest(image);
    for (std::size_t i = 0; i < sights_.size(); ++i) {
      const std::size_t cell = nearest_[i];
      if (cell == NOTHING) {
        sights_[i] = end(rays_[i], X_LS);
      } else {
        const Echo& echo = image.echo(cell);
        sights_[i] = {echo.x, echo.y, whose(cell)};
      }
    }
    return sights_;
  }

 private:
  static constexpr std::size_t NOTHING = static_cast<std::size_t>(-1);
  struct Ray {
    double x, y;  // in the sensor's frame, level
  };

  void find_nearest(const RangeImage& image) {
    std::fill(nearest_.begin(), nearest_.end(), NOTHING);
    for (int row = 0; row < image.rows(); ++row) {
      image.each_in_row(row, [&](int column, std::size_t cell) {
        std::size_t& nearest = nearest_[static_cast<std::size_t>(column / sector_)];
        if (nearest == NOTHING || image.range(cell) < image.range(nearest)) nearest = cell;
      });
    }
  }

  Sight end(const Ray& ray, const Transform& X_LS) const {
    const double x = X_LS.R[0] * ray.x + X_LS.R[1] * ray.y;
    const double y = X_LS.R[3] * ray.x + X_LS.R[4] * ray.y;
    const double scale = reach_ / std::hypot(x, y);
    return {X_LS.t[0] + scale * x, X_LS.t[1] + scale * y, -1};
  }

  int sector_;
  double reach_;
  std::vector<Ray> rays_;
  std::vector<std::size_t> nearest_;  // the cell of each sector's nearest echo
  std::vector<Sight> sights_;
};

}  // namespace twinscrew
