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

// The azimuth of (x, y), within 2e-6 rad, without branches. A minimax polynomial of atan on [0, 1]
// and three reflections; (0, 0) gives 0.
inline float fast_atan2(float y, float x) {
  const float ax = std::fabs(x), ay = std::fabs(y);
  const float small = ax < ay ? ax : ay;
  const float large = ax < ay ? ay : ax;
  const float z = small / (large > 0.0F ? large : 1.0F);
  const float s = z * z;
  float angle = -0.0117191266F;
  angle = angle * s + 0.0526473273F;
  angle = angle * s - 0.116426459F;
  angle = angle * s + 0.193540367F;
  angle = angle * s - 0.332622826F;
  angle = (angle * s + 0.999977219F) * z;
  constexpr float pi = std::numbers::pi_v<float>;
  angle = ax < ay ? 0.5F * pi - angle : angle;
  angle = x < 0.0F ? pi - angle : angle;
  return std::copysign(angle, y);
}

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
        azimuth_step_(azimuth_step) {
    if (rows_ < 2 || columns_ < 2 || !(azimuth_step > 0.0)) {
      throw std::invalid_argument("Scanner: needs two beams, two columns and a positive step");
    }
    const double turn = 2.0 * std::numbers::pi;
    first_azimuth_ = static_cast<float>(std::remainder(first_azimuth, turn));
    per_step_ = static_cast<float>(1.0 / azimuth_step);
    turn_ = static_cast<float>(turn / azimuth_step);
    last_ = static_cast<float>(columns) - 0.5F;
    make_edges();
    make_table();
  }

  int rows() const { return rows_; }
  int columns() const { return columns_; }
  bool wraps() const { return wraps_; }
  double azimuth_step() const { return azimuth_step_; }
  const std::vector<double>& elevations() const { return elevations_; }

  // The column as a real number: a column's own azimuth is at its whole number; in [-0.5, turn).
  float column_of(float x, float y) const {
    float column = (fast_atan2(y, x) - first_azimuth_) * per_step_;
    column += column < -0.5F ? turn_ : 0.0F;
    column -= column >= turn_ - 0.5F ? turn_ : 0.0F;
    return column;
  }

  // The whole column, or -1 where no beam is fired.
  int column(float real) const {
    if (!(real < last_)) return -1;
    const int whole = static_cast<int>(real + 0.5F);
    return whole < columns_ ? whole : -1;
  }

  // The beam of a direction, given as the tangent of its elevation, or -1 if it fits none.
  int row(float tangent) const {
    if (!(tangent >= edges_.front() && tangent < edges_.back())) return -1;
    const auto bin = static_cast<std::size_t>((tangent - edges_.front()) * bins_per_unit_);
    int row = table_[std::min(bin, table_.size() - 1)];
    while (tangent >= edges_[static_cast<std::size_t>(row) + 1]) ++row;  // at most two steps
    return row;
  }

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

  // For each bin of tangents the row in which the bin before it begins: rounding cannot pass it.
  void make_table() {
    float narrowest = std::numeric_limits<float>::max();
    for (std::size_t i = 0; i + 1 < edges_.size(); ++i) {
      narrowest = std::min(narrowest, edges_[i + 1] - edges_[i]);
    }
    const float span = edges_.back() - edges_.front();
    const double bins = std::clamp(std::ceil(double{span} / narrowest), 1.0, 65536.0);
    bins_per_unit_ = static_cast<float>(bins) / span;
    table_.resize(static_cast<std::size_t>(bins));
    int row = 0;
    for (std::size_t bin = 0; bin < table_.size(); ++bin) {
      const float begin =
          edges_.front() + (static_cast<float>(bin) - 1.0F) / bins_per_unit_;
      while (row + 1 < rows_ && edges_[static_cast<std::size_t>(row) + 1] <= begin) ++row;
      table_[bin] = row;
    }
  }

  int rows_, columns_;
  bool wraps_;
  std::vector<double> elevations_;
  double azimuth_step_;
  float first_azimuth_ = 0.0F, per_step_ = 0.0F, turn_ = 0.0F, last_ = 0.0F;
  float bins_per_unit_ = 0.0F;
  std::vector<float> edges_;
  std::vector<int> table_;
};

}  // namespace twinscrew
