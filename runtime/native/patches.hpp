// Patches: what lies in one small square of the horizontal plane, with its true bounds.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "range_image.hpp"
#include "union_find.hpp"

namespace twinscrew {

// The echoes within one square of the plane. All of them belong to one object.
struct Patch {
  float x_min, x_max, y_min, y_max;  // [m] tight bounds of the echoes
  double x_sum, y_sum;
  std::int32_t count;
  std::int32_t fragment;  // a component of the segmentation that has echoes here
  std::int32_t square_x, square_y;
};

// The least distance between two patches' bounds, squared.
inline float distance2(const Patch& a, const Patch& b) {
  const float dx = std::max({0.0F, a.x_min - b.x_max, b.x_min - a.x_max});
  const float dy = std::max({0.0F, a.y_min - b.y_max, b.y_min - a.y_max});
  return dx * dx + dy * dy;
}

// Sorts echoes into squares, and unites the fragments that come within `gap` of each other.
class PatchMap {
 public:
  // reach [m]: how far from the vessel's origin an echo can be; farther ones count as that far.
  PatchMap(float reach, float gap, std::size_t cells)
      : gap_(gap),
        // Two squares to a gap; but no more than 2048 squares a side.
        per_metre_(std::min(2.0F / gap, 1023.0F / reach)),
        half_(static_cast<std::int32_t>(std::ceil(reach * per_metre_))),
        side_(2 * half_ + 1),
        square_(static_cast<std::size_t>(side_) * static_cast<std::size_t>(side_), NONE),
        patch_of_(cells) {
    patches_.reserve(cells);
    // Half of the squares around one: the other half look at it themselves.
    const auto far = static_cast<std::int32_t>(std::ceil(gap * per_metre_)) + 1;
    for (std::int32_t dx = 0; dx <= far; ++dx) {
      for (std::int32_t dy = dx == 0 ? 1 : -far; dy <= far; ++dy) {
        const float nx = static_cast<float>(std::max(0, std::abs(dx) - 1)) / per_metre_;
        const float ny = static_cast<float>(std::max(0, std::abs(dy) - 1)) / per_metre_;
        if (nx * nx + ny * ny < gap * gap) around_.push_back({dx, dy});
      }
    }
  }

  // Unites the fragments, `labels` in 0 .. components - 1, that are one object.
  void operator()(const RangeImage& image, const std::vector<std::int32_t>& labels,
                  std::int32_t components) {
    clear();
    for (std::int32_t i = 0; i < components; ++i) fragments_.add();
    image.each([&](std::size_t cell) { add(image.echo(cell), cell, labels[cell]); });
    const float limit = gap_ * gap_;
    for (const Patch& patch : patches_) {
      for (const Offset& offset : around_) {
        const std::int32_t other = at(patch.square_x + offset.dx, patch.square_y + offset.dy);
        if (other == NONE) continue;
        const Patch& beside = patches_[static_cast<std::size_t>(other)];
        if (patch.fragment != beside.fragment && distance2(patch, beside) <= limit) {
          fragments_.unite(patch.fragment, beside.fragment);
        }
      }
    }
  }

  void reserve(std::size_t fragments) { fragments_.reserve(fragments); }
  const std::vector<Patch>& patches() const { return patches_; }
  std::size_t patch_of(std::size_t cell) const {
    return static_cast<std::size_t>(patch_of_[cell]);
  }
  std::int32_t object_of(const Patch& patch) { return fragments_.find(patch.fragment); }

 private:
  static constexpr std::int32_t NONE = -1;
  struct Offset {
    std::int32_t dx, dy;
  };

  void clear() {
    for (const Patch& patch : patches_) square_[flat(patch.square_x, patch.square_y)] = NONE;
    patches_.clear();
    fragments_.clear();
  }

  std::size_t flat(std::int32_t x, std::int32_t y) const {
    return static_cast<std::size_t>(x) * static_cast<std::size_t>(side_) +
           static_cast<std::size_t>(y);
  }

  std::int32_t at(std::int32_t x, std::int32_t y) const {
    return x >= 0 && x < side_ && y >= 0 && y < side_ ? square_[flat(x, y)] : NONE;
  }

  std::int32_t square(float metres) const {
    const float limit = static_cast<float>(half_);
    // Truncation of a shifted, positive number rounds down; clamping also takes care of NaN.
    const float steps = metres * per_metre_;
    const float inside = steps > -limit ? (steps < limit ? steps : limit) : -limit;
    return static_cast<std::int32_t>(inside + limit);
  }

  void add(const Echo& echo, std::size_t cell, std::int32_t fragment) {
    const std::int32_t x = square(echo.x), y = square(echo.y);
    std::int32_t& here = square_[flat(x, y)];
    if (here == NONE) {
      here = static_cast<std::int32_t>(patches_.size());
      patches_.push_back({echo.x, echo.x, echo.y, echo.y, 0.0, 0.0, 0, fragment, x, y});
    }
    patch_of_[cell] = here;
    Patch& patch = patches_[static_cast<std::size_t>(here)];
    patch.x_min = std::min(patch.x_min, echo.x);
    patch.x_max = std::max(patch.x_max, echo.x);
    patch.y_min = std::min(patch.y_min, echo.y);
    patch.y_max = std::max(patch.y_max, echo.y);
    patch.x_sum += echo.x;
    patch.y_sum += echo.y;
    ++patch.count;
    if (patch.fragment != fragment) fragments_.unite(patch.fragment, fragment);
  }

  float gap_, per_metre_;
  std::int32_t half_, side_;
  std::vector<std::int32_t> square_;    // the patch of each square
  std::vector<std::int32_t> patch_of_;  // the patch of each occupied cell of the range image
  std::vector<Patch> patches_;
  std::vector<Offset> around_;
  UnionFind fragments_;
};

}  // namespace twinscrew
