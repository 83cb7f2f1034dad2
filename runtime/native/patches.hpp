// Patches: what lies in one small square of the horizontal plane, with its true bounds.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "lanes.hpp"
#include "plane.hpp"
#include "range_image.hpp"
#include "segmentation.hpp"
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

// Echoes side by side in a row of the image, in one patch, each near the one before.
struct Stretch {
  std::size_t first, last;  // cells
  std::int32_t patch, count;
  double x_sum, y_sum;  // [m]
  bool joined;          // its first echo is near the row's echo before it
  bool exact;           // nothing was rounded in its sums
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
  PatchMap(const Plane& plane, const MergeRule& rule, float gap, std::size_t cells)
      : rule_(rule),
        gap2_(gap * gap),
        plane_(plane),
        at_(static_cast<std::size_t>(plane.side) * static_cast<std::size_t>(plane.side), NONE),
        patch_of_(cells) {
    patches_.reserve(cells);
    stretches_.reserve(cells);
    fragments_.reserve(cells);
    const float farthest = std::max(rule.across, rule.along);
    // Half of the squares around one: the other half look at it themselves.
    const auto far =
        std::min(static_cast<std::int32_t>(std::ceil(farthest * plane.per_metre)) + 1, plane.side - 1);
    for (std::int32_t dx = 0; dx <= far; ++dx) {
      for (std::int32_t dy = dx == 0 ? 1 : -far; dy <= far; ++dy) {
        const float nx = static_cast<float>(std::max(0, std::abs(dx) - 1)) / plane.per_metre;
        const float ny = static_cast<float>(std::max(0, std::abs(dy) - 1)) / plane.per_metre;
        if (nx * nx + ny * ny < farthest * farthest) around_.push_back(dx * plane.side + dy);
      }
    }
    // Beyond the last square there is nothing, as far as anybody looks.
    at_.resize(at_.size() + static_cast<std::size_t>(far * (plane.side + 1)), NONE);
  }

  // Unites the fragments, `components` many, that are one object.
  void operator()(const RangeImage& image, const Segmentation& segmentation,
                  std::int32_t components) {
    clear();
    for (std::int32_t i = 0; i < components; ++i) fragments_.add();
    gather(image, segmentation);
    for (const Patch& patch : patches_) unite_around(patch);
  }

  const std::vector<Patch>& patches() const { return patches_; }
  // Of a row of the image, or of all.
  std::span<const Stretch> stretches(int row) const {
    const std::size_t begin = row_begin_[static_cast<std::size_t>(row)];
    return {stretches_.data() + begin, row_begin_[static_cast<std::size_t>(row) + 1] - begin};
  }
  const std::vector<Stretch>& stretches() const { return stretches_; }
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
    stretches_.clear();
    row_begin_.clear();
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

  // What is summed up of echoes side by side in one patch. It goes on from the end of a row to the
  // begin of the next, and a stretch does not: `before` is what other rows have of it.
  struct Sum {
    Float4 bounds;  // [m] of x, y, -x, -y: the least
    Double2 places, places_before;
    std::int32_t count, count_before, fragment, square, patch;
    std::size_t first, last, before;  // cells; before: the last of the row's stretch before, or NO_CELL
  };
  static constexpr std::size_t NO_CELL = std::numeric_limits<std::size_t>::max();

  // Cuts the rows into stretches, and adds each to its patch. What an echo is added to are variables
  // that nothing else refers to, so that they stay in registers.
  void gather(const RangeImage& image, const Segmentation& segmentation) {
    const std::int32_t* const label = segmentation.labels().data();
    const Echo* const echoes = image.echoes();
    std::int32_t* const patch_of = patch_of_.data();
    Float4 bounds{};
    Double2 places{}, places_before{};
    std::int32_t count = 0, count_before = 0, fragment = NONE, square = NONE, patch = NONE;
    std::int32_t here_label = NONE;
    for (int row = 0; row < image.rows(); ++row) {
      row_begin_.push_back(stretches_.size());
      std::size_t first = image.cell(row, std::max(image.first_in_row(row), 0)), last = first;
      std::size_t before = NO_CELL;
      places_before = places;
      count_before = count;
      const std::uint64_t* const words = image.row_words(row);
      for (std::size_t w = 0; w < image.words(); ++w) {
        if (words[w] == 0) continue;
        const std::size_t begin = image.cell(row, 0) + w * RangeImage::WORD;
        const std::uint64_t starts = segmentation.starts()[begin / RangeImage::WORD];
        std::int32_t run = segmentation.first_run()[begin / RangeImage::WORD] - 1;
        for (std::uint64_t bits = words[w]; bits != 0; bits &= bits - 1) {
          if ((starts & bits & -bits) != 0) here_label = label[++run];
          const std::size_t cell = begin + static_cast<std::size_t>(std::countr_zero(bits));
          const Float4 echo = load(&echoes[cell].x), here = mirrored(echo);
          const Double2 place = first_two(echo);
          if (echoes[cell].square == square && here_label == fragment) {
            bounds = lesser(here, bounds);
            places += place;
            ++count;
          } else {
            const Sum sum{bounds,   places, places_before, count, count_before,
                          fragment, square, patch,         first, last,  before};
            if (count > count_before) {
              cut(image, sum);
              before = last;
            }
            put(sum);
            bounds = here;
            places = place;
            places_before = Double2{};
            count = 1;
            count_before = 0;
            square = echoes[cell].square;
            fragment = here_label;
            patch = number_at(square);
            first = cell;
          }
          last = cell;
          patch_of[cell] = patch;
        }
      }
      const Sum sum{bounds,   places, places_before, count, count_before,
                    fragment, square, patch,         first, last,  before};
      if (count > count_before) cut(image, sum);
      if (row + 1 == image.rows()) put(sum);
    }
    row_begin_.push_back(stretches_.size());
  }

  static Float4 mirrored(Float4 echo) {
    const Int4 twice = reinterpret_cast<Int4>(__builtin_shufflevector(echo, echo, 0, 1, 0, 1));
    constexpr std::int32_t sign = std::numeric_limits<std::int32_t>::min();
    return reinterpret_cast<Float4>(twice ^ Int4{0, 0, sign, sign});  // x, y, -x, -y
  }

  // Notes the stretch that ends.
  void cut(const RangeImage& image, const Sum& sum) {
    const Echo* const echoes = image.echoes();
    const bool joined =
        sum.before != NO_CELL && is_near(echoes[sum.before], echoes[sum.first]);
    const Float4 b = sum.bounds;
    const float x = b[0] + b[2], y = b[1] + b[3];

    if (x * x + y * y < gap2_) {  // so is each echo near the one before
      const Double2 places = sum.places - sum.places_before;
      stretches_.push_back({sum.first, sum.last, sum.patch, sum.count - sum.count_before, places[0],
                            places[1], joined, is_exact(b)});
    } else {
      split(echoes, image, sum, joined);
    }
  }

  // Coordinates of at least a 64th of a metre are multiples of 2^-29 m, and so are their sums as far as
  // a row goes: no sum is rounded, whatever its order.
  static bool is_exact(const Float4& b) {
    constexpr float least = 1.0F / 64.0F;
    const unsigned beyond = bits(b > least);  // no branch: it would be guessed wrongly
    return ((beyond | beyond >> 2) & 3U) == 3U;
  }

  // Splits a stretch where echoes side by side are far apart.
  void split(const Echo* echoes, const RangeImage& image, const Sum& sum, bool joined) {
    const bool exact = is_exact(sum.bounds);
    Stretch part{sum.first, sum.first, sum.patch, 0, 0.0, 0.0, joined, exact};
    image.each_between(sum.first, sum.last, [&](std::size_t cell) {
      if (!is_near(echoes[part.last], echoes[cell])) {
        stretches_.push_back(part);
        part = {cell, cell, sum.patch, 0, 0.0, 0.0, false, exact};
      }
      part.last = cell;
      part.x_sum += echoes[cell].x;
      part.y_sum += echoes[cell].y;
      ++part.count;
    });
    stretches_.push_back(part);
  }

  bool is_near(const Echo& a, const Echo& b) const {
    const float dx = b.x - a.x, dy = b.y - a.y;
    return dx * dx + dy * dy < gap2_;
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

  void put(const Sum& sum) {
    if (sum.count == 0) return;
    const Float4 b = sum.bounds;
    const Patch added{b[0],          -b[2],     b[1],         -b[3],     sum.places[0],
                      sum.places[1], sum.count, sum.fragment, sum.square};
    Patch& patch = patches_[static_cast<std::size_t>(sum.patch)];
    if (patch.count == 0) {
      patch = added;
      return;
    }
    if (patch.fragment != sum.fragment) fragments_.unite(patch.fragment, sum.fragment);
    add(patch, added);
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
  float gap2_;  // [m2] the least between echoes that are not of one stretch
  Plane plane_;
  std::vector<std::int32_t> at_;        // the patch of each square
  std::vector<std::int32_t> patch_of_;  // the patch of each occupied cell of the range image
  std::vector<Patch> patches_;
  std::vector<Stretch> stretches_;      // of the image, from its first cell to its last
  std::vector<std::size_t> row_begin_;  // of each row: its first stretch; then their number
  std::vector<std::int32_t> around_;    // from a square to those near it that come later
  UnionFind fragments_;
};

}  // namespace twinscrew
