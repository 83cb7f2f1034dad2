// A LiDAR as the kernel needs it: from a direction to a cell of the range image.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <stdexcept>
#include <vector>

namespace twinscrew {

// How directions become columns and bins of elevation.
struct Bins {
  float first_azimuth, per_step, turn, columns;  // [rad], [1/rad], [columns], [columns]
  float lowest, highest, per_tangent, last;      // [-] tangents, [bins], [bins]
};

// How bins of elevation become rows.
struct Rows {
  const std::int32_t* table;  // of each bin: the row in which the bin before it begins
  const float* edges;         // of each row: the tangent at which it begins

  // The row of a direction, from its bin (not -1) and the tangent of its elevation.
  std::size_t of(std::int32_t bin, float tangent) const {
    const auto row = static_cast<std::size_t>(table[bin]);
    return row + static_cast<std::size_t>(tangent >= edges[row + 1]);
  }
};

// The image: row 0 is the lowest beam, column 0 the first azimuth, clockwise. All of it is derived
// from the sensor's description, nothing is rounded to a nominal resolution.
class Scanner {
 public:
  // elevations [rad] ascending, upwards; azimuths [rad] clockwise from x forward.
  Scanner(std::span<const double> elevations, double first_azimuth, double azimuth_step,
          int columns, bool wraps)
      : rows_(static_cast<int>(elevations.size())),
        columns_(columns),
        wraps_(wraps),
        elevations_(elevations.begin(), elevations.end()),
        first_azimuth_(first_azimuth),
        azimuth_step_(azimuth_step) {
    if (rows_ < 2 || columns_ < 2 || !(azimuth_step > 0.0)) {
      throw std::invalid_argument("Scanner: needs two beams, two columns and a positive step");
    }
    const double turn = 2.0 * std::numbers::pi;
    make_edges();
    make_table();
    bins_.first_azimuth = static_cast<float>(std::remainder(first_azimuth, turn));
    bins_.per_step = static_cast<float>(1.0 / azimuth_step);
    bins_.turn = static_cast<float>(turn / azimuth_step);
    bins_.columns = static_cast<float>(columns);
  }

  int rows() const { return rows_; }
  int columns() const { return columns_; }
  bool wraps() const { return wraps_; }
  double azimuth_step() const { return azimuth_step_; }
  // Of a column, or of a place between two [rad].
  double azimuth(double column) const { return first_azimuth_ + column * azimuth_step_; }
  const std::vector<double>& elevations() const { return elevations_; }

  const Bins& bins() const { return bins_; }

  Rows to_rows() const { return {table_.data(), edges_.data()}; }

 private:
  // Tangents of the elevations half way between beams; the outer beams reach as far outwards.
  void make_edges() {
    const auto n = elevations_.size();
    const auto tangent = [](double elevation) {
      const double limit = 0.5 * std::numbers::pi - 1e-6;
      return static_cast<float>(std::tan(std::clamp(elevation, -limit, limit)));
    };
    edges_.push_back(tangent(elevations_[0] - 0.5 * (elevations_[1] - elevations_[0])));
    for (std::size_t i = 1; i < n; ++i) {
      edges_.push_back(tangent(0.5 * (elevations_[i - 1] + elevations_[i])));
    }
    edges_.push_back(
        tangent(elevations_[n - 1] + 0.5 * (elevations_[n - 1] - elevations_[n - 2])));
    for (std::size_t i = 0; i < n; ++i) {
      if (!(edges_[i] < edges_[i + 1])) throw std::invalid_argument("Scanner: beams coincide");
    }
  }

  // For each bin of tangents the row in which the bin before it begins, so that rounding cannot
  // pass it. Two bins to the narrowest row: a direction is in that row or in the next.
  void make_table() {
    const float lowest = edges_.front(), highest = edges_.back();
    float narrowest = highest - lowest;
    for (std::size_t i = 0; i + 1 < edges_.size(); ++i) {
      narrowest = std::min(narrowest, edges_[i + 1] - edges_[i]);
    }
    const double bins = std::ceil(2.0 * double{highest - lowest} / narrowest);
    if (!(bins < 1e6)) throw std::invalid_argument("Scanner: beams too close to each other");
    table_.resize(static_cast<std::size_t>(bins));
    const double width = double{highest - lowest} / bins;
    int row = 0;
    for (std::size_t bin = 0; bin < table_.size(); ++bin) {
      const double begin = lowest + (static_cast<double>(bin) - 1.0) * width;
      while (row + 1 < rows_ && edges_[static_cast<std::size_t>(row) + 1] <= begin) ++row;
      table_[bin] = row;
    }
    bins_.lowest = lowest;
    bins_.highest = highest;
    bins_.per_tangent = static_cast<float>(1.0 / width);
    bins_.last = static_cast<float>(bins) - 1.0F;
  }

  int rows_, columns_;
  bool wraps_;
  std::vector<double> elevations_;
  double first_azimuth_, azimuth_step_;
  Bins bins_{};
  std::vector<float> edges_;
  std::vector<std::int32_t> table_;
};

}  // namespace twinscrew
