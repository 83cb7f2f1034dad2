// The outline: how far each sector's sight goes, whatever the row. Up to there the water is free.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "projection.hpp"
#include "range_image.hpp"
#include "scanner.hpp"

namespace twinscrew {

struct Sight {
  double x, y;        // [m] levelled frame B: the nearest echo, or the end of what is looked at
  double height;      // [m] of the echo, up from the vessel's origin; NaN where there is none
  std::int32_t seen;  // what `whose` says of the echo's cell, -1 where there is none
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
    sights_.resize(rays_.size());
  }

  // X_LS: from the sensor to the levelled frame B.
  template <class Whose>
  const std::vector<Sight>& operator()(const RangeImage& image, const Transform& X_LS,
                                       Whose whose) {
    find_nearest(image);
    std::size_t i = 0;
    for (int first = 0; first < columns_; first += sector_, ++i) {
      const auto begin = range_.begin() + first;
      const auto nearest = std::min_element(begin, range_.begin() + end_of(first));
      if (*nearest == NOTHING) {
        sights_[i] = end(rays_[i], X_LS);
      } else {
        const auto column = static_cast<int>(nearest - range_.begin());
        const std::size_t cell = image.cell(row_[static_cast<std::size_t>(column)], column);
        const double height = height_of(row_[static_cast<std::size_t>(column)], i, *nearest, X_LS);
        sights_[i] = {image.echo(cell).x, image.echo(cell).y, height, whose(cell)};
      }
    }
    return sights_;
  }

 private:
  static constexpr float NOTHING = std::numeric_limits<float>::infinity();
  struct Ray {
    double x, y;  // in the sensor's frame, level
  };

  int end_of(int first) const { return std::min(first + sector_, columns_); }

  // Finds each column's nearest echo; where a row has echoes side by side, many at once.
  void find_nearest(const RangeImage& image) {
    std::fill(range_.begin(), range_.end(), NOTHING);
    for (int row = 0; row < image.rows(); ++row) {
      const float* const ranges = image.ranges() + image.cell(row, 0);
      const std::uint64_t* const words = image.row_words(row);
      for (std::size_t word = 0; word < image.words(); ++word) {
        const std::size_t first = word * RangeImage::WORD;
        if (words[word] == ALL) {
          keep_all(ranges + first, row, &range_[first], &row_[first]);
        } else {
          for (std::uint64_t bits = words[word]; bits != 0; bits &= bits - 1) {
            const std::size_t column = first + static_cast<std::size_t>(std::countr_zero(bits));
            keep(column, row, ranges[column]);
          }
        }
      }
    }
  }

  static void keep_all(const float* ranges, std::int32_t row, float* __restrict nearest,
                       std::int32_t* __restrict rows) {
    for (std::size_t k = 0; k < RangeImage::WORD; ++k) {
      const bool is_nearer = ranges[k] < nearest[k];
      rows[k] = is_nearer ? row : rows[k];
      nearest[k] = is_nearer ? ranges[k] : nearest[k];
    }
  }

  void keep(std::size_t column, int row, float range) {
    const bool is_nearer = range < range_[column];
    row_[column] = is_nearer ? row : row_[column];
    range_[column] = is_nearer ? range : range_[column];
  }

  Sight end(const Ray& ray, const Transform& X_LS) const {
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

  static constexpr std::uint64_t ALL = ~std::uint64_t{0};

  int columns_, sector_;
  double reach_;
  std::vector<double> elevations_;
  std::vector<float> range_;       // [m] of each column's nearest echo
  std::vector<std::int32_t> row_;  // and where it is
  std::vector<Ray> rays_;
  std::vector<Sight> sights_;
};

}  // namespace twinscrew
