// Patches: what lies in one small square of the horizontal plane, with its true bounds.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "lanes.hpp"
#include "plane.hpp"
#include "range_image.hpp"
#include "union_find.hpp"

namespace twinscrew {

// The echoes within one square of the plane. All of them belong to one object.
struct Patch {
  float x_min, x_max, y_min, y_max;  // [m] tight bounds of the echoes
  double x_sum, y_sum;
  std::int32_t count;
  std::int32_t fragment;  // a component of the segmentation that has echoes here
  std::int32_t square;
};

// Occupied cells side by side in a row that lie in one patch.
struct PatchSpan {
  std::size_t first, last;  // cells
  std::int32_t patch;
};

// How far apart two things of one object may be, seen from above: gaps across the line of sight are
// real, gaps along it also come from grazing beams and from shadows.
struct MergeRule {
  float across, along;  // [m]
};

// From one patch's bounds to another's: the shortest vector's coordinate on one axis.
inline float between(float a_min, float a_max, float b_min, float b_max) {
  return b_min > a_max ? b_min - a_max : (b_max < a_min ? b_max - a_min : 0.0F);
}

// Is b within an ellipse about a, whose long axis points to the vessel?
inline bool near(const Patch& a, const Patch& b, const MergeRule& rule) {
  const float dx = between(a.x_min, a.x_max, b.x_min, b.x_max);
  const float dy = between(a.y_min, a.y_max, b.y_min, b.y_max);
  const float x = a.x_min + a.x_max + b.x_min + b.x_max, y = a.y_min + a.y_max + b.y_min + b.y_max;
  const float r2 = x * x + y * y;  // the direction of sight is (x, y) / r
  const float radial = dx * x + dy * y, lateral = dx * y - dy * x;
  return lateral * lateral * rule.along * rule.along + radial * radial * rule.across * rule.across <=
         r2 * rule.along * rule.along * rule.across * rule.across;
}

// Sorts echoes into squares, and unites the fragments that are near each other.
class PatchMap {
 public:
  PatchMap(const Plane& plane, const MergeRule& rule, std::size_t cells)
      : rule_(rule),
        plane_(plane),
        at_(static_cast<std::size_t>(plane.side) * static_cast<std::size_t>(plane.side), NONE),
        patch_of_(cells) {
    patches_.reserve(cells);
    spans_.reserve(cells);
    fragments_.reserve(cells);
    const float gap = std::max(rule.across, rule.along);
    // Half of the squares around one: the other half look at it themselves.
    const auto far =
        std::min(static_cast<std::int32_t>(std::ceil(gap * plane.per_metre)) + 1, plane.side - 1);
    for (std::int32_t dx = 0; dx <= far; ++dx) {
      for (std::int32_t dy = dx == 0 ? 1 : -far; dy <= far; ++dy) {
        const float nx = static_cast<float>(std::max(0, std::abs(dx) - 1)) / plane.per_metre;
        const float ny = static_cast<float>(std::max(0, std::abs(dy) - 1)) / plane.per_metre;
        if (nx * nx + ny * ny < gap * gap) around_.push_back(dx * plane.side + dy);
      }
    }
    // Beyond the last square there is nothing, as far as anybody looks.
    at_.resize(at_.size() + static_cast<std::size_t>(far * (plane.side + 1)), NONE);
  }

  // Unites the fragments, `labels` in 0 .. components - 1, that are one object.
  void operator()(const RangeImage& image, const std::vector<std::int32_t>& labels,
                  std::int32_t components) {
    clear();
    for (std::int32_t i = 0; i < components; ++i) fragments_.add();
    gather(image, labels);
    for (const Patch& patch : patches_) unite_around(patch);
  }

  const std::vector<Patch>& patches() const { return patches_; }
  const std::vector<PatchSpan>& spans() const { return spans_; }
  std::size_t patch_of(std::size_t cell) const {
    return static_cast<std::size_t>(patch_of_[cell]);
  }
  void unite(std::int32_t a, std::int32_t b) {
    fragments_.unite(patches_[static_cast<std::size_t>(a)].fragment,
                     patches_[static_cast<std::size_t>(b)].fragment);
  }
  std::int32_t object_of(const Patch& patch) { return fragments_.find(patch.fragment); }

 private:
  static constexpr std::int32_t NONE = -1;

  void clear() {
    for (const Patch& patch : patches_) at_[static_cast<std::size_t>(patch.square)] = NONE;
    patches_.clear();
    spans_.clear();
    fragments_.clear();
  }

  // Past the end of a column of squares comes the next one's begin: `near` knows better.
  void unite_around(const Patch& patch) {
    const std::int32_t* const here = &at_[static_cast<std::size_t>(patch.square)];
    for (const std::int32_t offset : around_) {
      const std::int32_t other = here[offset];
      if (other == NONE) continue;
      const Patch& beside = patches_[static_cast<std::size_t>(other)];
      if (patch.fragment != beside.fragment && near(patch, beside, rule_)) {
        fragments_.unite(patch.fragment, beside.fragment);
      }
    }
  }

  // What lies in one square side by side in a row; made for registers.
  struct Stretch {
    Float4 bounds{};  // [m] of x, y, -x, -y: the least
    double x_sum = 0.0, y_sum = 0.0;
    std::int32_t count = 0, fragment = NONE, square = NONE;

    Patch patch() const {
      return {bounds[0], -bounds[2], bounds[1], -bounds[3], x_sum, y_sum, count, fragment, square};
    }
  };

  // Neighbours in a row mostly share a square, so they are added up before they are stored.
  void gather(const RangeImage& image, const std::vector<std::int32_t>& labels) {
    std::int32_t* const patch_of = patch_of_.data();
    Stretch sum;
    std::int32_t number = NONE;
    for (int row = 0; row < image.rows(); ++row) {
      std::size_t first = image.size(), last = first;  // no cell yet
      image.each_in_row(row, [&](int, std::size_t cell) {
        const Echo& echo = image.echo(cell);
        const std::int32_t fragment = labels[cell];
        const Float4 here{echo.x, echo.y, -echo.x, -echo.y};
        if (number != NONE && sum.square == echo.square && sum.fragment == fragment) {
          sum.bounds = lesser(here, sum.bounds);
          sum.x_sum += echo.x;
          sum.y_sum += echo.y;
          ++sum.count;
        } else {
          if (first < image.size()) spans_.push_back({first, last, number});
          first = image.size();
          put(sum.patch(), number);
          sum = {here, echo.x, echo.y, 1, fragment, echo.square};
          number = number_at(echo.square);
        }
        if (first == image.size()) first = cell;
        last = cell;
        patch_of[cell] = number;
      });
      if (first < image.size()) spans_.push_back({first, last, number});
    }
    put(sum.patch(), number);
  }

  // The number of a square's patch, which is made if it has none.
  std::int32_t number_at(std::int32_t square) {
    std::int32_t& here = at_[static_cast<std::size_t>(square)];
    if (here == NONE) {
      here = static_cast<std::int32_t>(patches_.size());
      patches_.push_back({});
    }
    return here;
  }

  void put(const Patch& sum, std::int32_t number) {
    if (number == NONE) return;
    Patch& patch = patches_[static_cast<std::size_t>(number)];
    if (patch.count == 0) {
      patch = sum;
      return;
    }
    if (patch.fragment != sum.fragment) fragments_.unite(patch.fragment, sum.fragment);
    add(patch, sum);
  }

  static void add(Patch& a, const Patch& b) {
    a.x_min = b.x_min < a.x_min ? b.x_min : a.x_min;
    a.x_max = b.x_max > a.x_max ? b.x_max : a.x_max;
    a.y_min = b.y_min < a.y_min ? b.y_min : a.y_min;
    a.y_max = b.y_max > a.y_max ? b.y_max : a.y_max;
    a.x_sum += b.x_sum;
    a.y_sum += b.y_sum;
    a.count += b.count;
  }

  MergeRule rule_;
  Plane plane_;
  std::vector<std::int32_t> at_;        // the patch of each square
  std::vector<std::int32_t> patch_of_;  // the patch of each occupied cell of the range image
  std::vector<Patch> patches_;
  std::vector<PatchSpan> spans_;        // of the image, from its first cell to its last
  std::vector<std::int32_t> around_;    // from a square to those near it that come later
  UnionFind fragments_;
};

}  // namespace twinscrew
