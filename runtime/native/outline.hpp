// The outline: the boundary of the free water, one point for each sector of azimuth.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "lanes.hpp"
#include "projection.hpp"
#include "range_image.hpp"
#include "scanner.hpp"

namespace twinscrew {

struct BoundaryPoint {
  double x, y;        // [m] levelled frame L: the nearest echo, or a point at the greatest range
  double height;      // [m] of the echo, up from the vessel's origin; NaN where there is none
  std::int32_t seen;  // what `object_of` gives for the echo's cell; -1 where there is no echo
};

class Outline {
 public:
  // A sector is so many columns side by side; the last may have fewer. reach: [m].
  Outline(const Scanner& scanner, int sector, double reach)
      : columns_(scanner.columns()),
        sector_(sector),
        reach_(reach),
        elevations_(scanner.elevations()),
        range_(static_cast<std::size_t>(columns_) + RangeImage::WORD),
        row_(range_.size()) {
    for (int first = 0; first < columns_; first += sector_) {
      const double azimuth = scanner.azimuth(0.5 * (first + end_of(first) - 1));
      rays_.push_back({std::cos(azimuth), std::sin(azimuth)});
    }
    boundary_.resize(rays_.size());
  }

  // X_LS: from the sensor to the levelled frame L.
  template <class ObjectOf>
  const std::vector<BoundaryPoint>& operator()(const RangeImage& image, const Transform& X_LS,
                                               ObjectOf object_of) {
    find_nearest(image);
    std::size_t i = 0;
    for (int first = 0; first < columns_; first += sector_, ++i) {
      const auto begin = range_.begin() + first;
      const auto nearest = std::min_element(begin, range_.begin() + end_of(first));
      if (*nearest == NOTHING) {
        boundary_[i] = end(rays_[i], X_LS);
      } else {
        const auto column = static_cast<int>(nearest - range_.begin());
        const std::size_t cell = image.cell(row_[static_cast<std::size_t>(column)], column);
        const double height = height_of(row_[static_cast<std::size_t>(column)], i, *nearest, X_LS);
        boundary_[i] = {image.echo(cell).x, image.echo(cell).y, height, object_of(cell)};
      }
    }
    return boundary_;
  }

 private:
  static constexpr float NOTHING = std::numeric_limits<float>::infinity();
  struct Ray {
    double x, y;  // in the sensor's frame, level
  };

  int end_of(int first) const { return std::min(first + sector_, columns_); }

  // Finds each column's nearest echo, four columns at a time.
  void find_nearest(const RangeImage& image) {
    std::fill(range_.begin(), range_.end(), NOTHING);
    for (int row = 0; row < image.rows(); ++row) {
      const float* const ranges = image.ranges() + image.cell(row, 0);
      const std::uint64_t* const words = image.row_words(row);
      for (std::size_t word = 0; word < image.words(); ++word) {
        const std::uint64_t bits = words[word];
        // The first bit of each four that has any.
        std::uint64_t fours = (bits | bits >> 1 | bits >> 2 | bits >> 3) & 0x1111111111111111U;
        for (; fours != 0; fours &= fours - 1) {
          const auto lane = static_cast<std::size_t>(std::countr_zero(fours));
          const auto four = static_cast<std::int32_t>(bits >> lane & 15U);
          const std::size_t column = word * RangeImage::WORD + lane;
          const Int4 occupied = (Int4{four, four, four, four} & Int4{1, 2, 4, 8}) != 0;
          const Float4 here = load(ranges + column), nearest = load(&range_[column]);
          const Int4 is_nearer = (here < nearest) & occupied;
          Int4 rows;
          std::memcpy(&rows, &row_[column], sizeof rows);
          rows = is_nearer ? Int4{row, row, row, row} : rows;
          const Float4 least = select(is_nearer, here, nearest);
          std::memcpy(&row_[column], &rows, sizeof rows);
          std::memcpy(&range_[column], &least, sizeof least);
        }
      }
    }
  }

  BoundaryPoint end(const Ray& ray, const Transform& X_LS) const {
    const double x = X_LS.R[0] * ray.x + X_LS.R[1] * ray.y;
    const double y = X_LS.R[3] * ray.x + X_LS.R[4] * ray.y;
    const double scale = reach_ / std::hypot(x, y);
    const double none = std::numeric_limits<double>::quiet_NaN();
    return {X_LS.t[0] + scale * x, X_LS.t[1] + scale * y, none, -1};
  }

  // Of an echo of a row, in a sector.
  double height_of(int row, std::size_t sector, double range, const Transform& X_LS) const {
    const double elevation = elevations_[static_cast<std::size_t>(row)];
    const double level = range * std::cos(elevation);
    return -(X_LS.R[6] * level * rays_[sector].x + X_LS.R[7] * level * rays_[sector].y -
             X_LS.R[8] * range * std::sin(elevation) + X_LS.t[2]);
  }

  int columns_, sector_;
  double reach_;
  std::vector<double> elevations_;
  std::vector<float> range_;       // [m] of each column's nearest echo
  std::vector<std::int32_t> row_;  // and where it is
  std::vector<Ray> rays_;
  std::vector<BoundaryPoint> boundary_;
};

}  // namespace twinscrew
