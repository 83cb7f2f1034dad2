// The paper's Algorithm 1 on a range image: runs along the rows, united across them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "range_image.hpp"
#include "scanner.hpp"
#include "union_find.hpp"

namespace twinscrew {

struct Criterion {
  double theta = 0.0;  // [rad] the paper's threshold
  double noise = 0.0;  // [m] a difference of ranges that noise alone may make
  int bridged = 0;     // [-] missing echoes that a link may cross
};

// Links neighbours p, q if atan2(d2 sin a, d1 - d2 cos a) > theta, with d1 >= d2 their ranges and
// a the angle between their beams. For 0 < a, theta < pi that is
//     d1 < k d2,   k = cos a + sin a / tan theta,
// so one k for each pair of neighbouring directions holds all the trigonometry. The noise floor
// is added on the right.
class Segmentation {
 public:
  Segmentation(const Scanner& scanner, const Criterion& criterion)
      : noise_(static_cast<float>(criterion.noise)),
        reach_(criterion.bridged + 1),
        along_(static_cast<std::size_t>(scanner.rows() * reach_)),
        across_(along_.size()),
        below_(static_cast<std::size_t>(scanner.columns())),
        label_(static_cast<std::size_t>(scanner.rows()) *
               static_cast<std::size_t>(scanner.columns())) {
    const auto& e = scanner.elevations();
    for (int row = 0; row < scanner.rows(); ++row) {
      const auto r = static_cast<std::size_t>(row);
      for (int gap = 1; gap <= reach_; ++gap) {
        // Two beams of one elevation, `gap` columns apart: spherical law of cosines.
        const double c = std::cos(e[r]), s = std::sin(e[r]);
        const double cosine = s * s + c * c * std::cos(gap * scanner.azimuth_step());
        along_[index(row, gap)] = k(std::acos(std::clamp(cosine, -1.0, 1.0)), criterion.theta);
        const double angle = row >= gap ? e[r] - e[r - static_cast<std::size_t>(gap)] : 0.0;
        across_[index(row, gap)] = k(angle, criterion.theta);
      }
    }
    runs_.reserve(label_.size());
    compact_.reserve(label_.size());
  }

  // Gives every occupied cell a label, 0, 1, .. in order of a component's first cell.
  std::int32_t operator()(const RangeImage& image, bool wraps) {
    runs_.clear();
    std::fill(below_.begin(), below_.end(), NONE);
    for (int row = 0; row < image.rows(); ++row) link_row(image, row, wraps);
    return number_components(image);
  }

  const std::vector<std::int32_t>& labels() const { return label_; }

 private:
  static constexpr std::int32_t NONE = -1;

  static float k(double angle, double theta) {
    return static_cast<float>(std::cos(angle) + std::sin(angle) / std::tan(theta));
  }

  std::size_t index(int row, int gap) const {
    return static_cast<std::size_t>(row * reach_ + gap - 1);
  }

  static bool linked(float p, float q, float k, float noise) {
    const float far = p < q ? q : p, near = p < q ? p : q;
    return far < k * near + noise;
  }

  void link_row(const RangeImage& image, int row, bool wraps) {
    // Copies, which no store below can change: the loop keeps them in registers.
    const float* const along = &along_[index(row, 1)];
    const float* const across = &across_[index(row, 1)];
    const float* const ranges = image.ranges();
    std::int32_t* const labels = label_.data();
    std::int32_t* const below_row = below_.data();
    const float noise = noise_;
    const int reach = reach_;
    const auto columns = static_cast<std::size_t>(image.columns());
    int first = -1, last = -1;
    std::size_t first_cell = 0, last_cell = 0;
    std::int32_t run = NONE, united_with = NONE;
    image.each_in_row(row, [&](int column, std::size_t cell) {
      const float range = ranges[cell];
      const int gap = column - last;
      const bool joined = last >= 0 && gap <= reach &&
                          linked(range, ranges[last_cell], along[gap - 1], noise);
      if (!joined) {
        run = runs_.add();
        united_with = NONE;
      }
      labels[cell] = run;
      std::int32_t& below = below_row[static_cast<std::size_t>(column)];
      if (below != NONE) {
        const auto under = static_cast<std::size_t>(below);
        const auto rise = static_cast<int>((cell - under) / columns);
        if (rise <= reach && labels[under] != united_with &&
            linked(range, ranges[under], across[rise - 1], noise)) {
          united_with = labels[under];
          runs_.unite(run, united_with);
        }
      }
      below = static_cast<std::int32_t>(cell);
      if (first < 0) {
        first = column;
        first_cell = cell;
      }
      last = column;
      last_cell = cell;
    });
    if (!wraps || first < 0) return;
    const int gap = first + image.columns() - last;
    if (gap <= reach_ && first != last &&
        linked(ranges[first_cell], ranges[last_cell], along[gap - 1], noise)) {
      runs_.unite(label_[first_cell], label_[last_cell]);
    }
  }

  std::int32_t number_components(const RangeImage& image) {
    compact_.assign(runs_.size(), NONE);
    std::int32_t components = 0;
    for (std::size_t run = 0; run < runs_.size(); ++run) {
      // The root is a component's smallest run, so it has been numbered before its members.
      const auto root = static_cast<std::size_t>(runs_.find(static_cast<std::int32_t>(run)));
      compact_[run] = root == run ? components++ : compact_[root];
    }
    std::int32_t* const labels = label_.data();
    const std::int32_t* const compact = compact_.data();
    image.each([=](std::size_t cell) { labels[cell] = compact[labels[cell]]; });
    return components;
  }

  float noise_;
  int reach_;
  std::vector<float> along_, across_;  // k, one for each row and gap
  std::vector<std::int32_t> below_;    // the last occupied cell of each column
  std::vector<std::int32_t> label_;
  std::vector<std::int32_t> compact_;
  UnionFind runs_;
};

}  // namespace twinscrew
