// From patches to circles: one for an object, several for one too long for a circle.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "groups.hpp"
#include "patches.hpp"

namespace twinscrew {

struct Circle {
  double x, y;    // [m] centroid of the echoes
  double radius;  // [m] the largest distance of an echo from the centroid
  std::int64_t count;
  std::int32_t cut_from;  // the number of the object that this is a piece of, -1 if it is all of it
};

struct CircleRules {
  int least_points = 20;   // an object has so many echoes up to this distance,
  float full_range = 22.0F;  // [m]
  int far_points = 6;      // and as many fewer as its angle of sight is smaller, down to this
  float longest = 6.5F;  // [m] a longer object is cut
  float piece = 4.0F;    // [m] into pieces no longer than this
  bool has_hull = false;
  float hull_aft = 0.0F, hull_fore = 0.0F;  // [m] the own keel line: y = 0, x between these
};

class Circles {
 public:
  Circles(const CircleRules& rules, std::size_t cells) : rules_(rules) {
    circle_of_.reserve(cells);
    circles_.reserve(cells);
    outer_.reserve(cells);
  }

  void operator()(const RangeImage& image, const PatchMap& map, Groups& groups) {
    circles_.clear();
    circle_of_.assign(map.patches().size(), NONE);
    for (std::size_t group = 0; group < groups.size(); ++group) {
      if (!is_object(map.patches(), groups[group])) continue;
      const std::size_t first = circles_.size();
      cut(map.patches(), groups[group], rules_.longest);
      if (circles_.size() - first > 1) number(first, static_cast<std::int32_t>(group));
    }
    measure(image, map);
  }

  const std::vector<Circle>& circles() const { return circles_; }

  // The circle of an occupied cell, or -1 if its object had too few points.
  std::int32_t circle_of(const PatchMap& map, std::size_t cell) const {
    return circle_of_[map.patch_of(cell)];
  }
  std::int32_t circle_of(const Stretch& stretch) const {
    return circle_of_[static_cast<std::size_t>(stretch.patch)];
  }

 private:
  static constexpr std::int32_t NONE = -1;
  using Numbers = std::span<std::int32_t>;

  // Centroid and principal axis of some patches.
  struct Shape {
    double x, y;            // centroid of the echoes
    double axis_x, axis_y;  // unit vector along the longest extent
    double from, to;        // the extent along it
    double radius2;         // an upper bound of the squared radius
  };

  static std::size_t index(std::int32_t i) { return static_cast<std::size_t>(i); }

  // Has it so many echoes as a thing of the least size gives there?
  bool is_object(const std::vector<Patch>& patches, Numbers numbers) const {
    double x = 0.0, y = 0.0, count = 0.0;
    for (const std::int32_t i : numbers) {
      const Patch& p = patches[index(i)];
      x += p.x_sum;
      y += p.y_sum;
      count += p.count;
    }
    if (count >= rules_.least_points) return true;
    const double full = rules_.full_range, away2 = (x * x + y * y) / (count * count);
    if (away2 <= full * full || count < rules_.far_points) return false;
    return count * away2 >= rules_.least_points * full * full;
  }

  static std::int64_t points(const std::vector<Patch>& patches, Numbers numbers) {
    std::int64_t sum = 0;
    for (const std::int32_t p : numbers) sum += patches[index(p)].count;
    return sum;
  }

  // Each patch weighs the same in the axis, or the near end of a quay would outweigh the far one.
  static Shape shape(const std::vector<Patch>& patches, Numbers numbers) {
    double x = 0, y = 0, mx = 0, my = 0, mxx = 0, mxy = 0, myy = 0, count = 0;
    const auto n = static_cast<double>(numbers.size());
    for (const std::int32_t i : numbers) {
      const Patch& p = patches[index(i)];
      x += p.x_sum;
      y += p.y_sum;
      count += p.count;
      mx += p.x_sum / p.count;
      my += p.y_sum / p.count;
    }
    mx /= n;
    my /= n;
    for (const std::int32_t i : numbers) {
      const Patch& p = patches[index(i)];
      const double dx = p.x_sum / p.count - mx, dy = p.y_sum / p.count - my;
      mxx += dx * dx;
      mxy += dx * dy;
      myy += dy * dy;
    }
    const double angle = 0.5 * std::atan2(2.0 * mxy, mxx - myy);
    Shape s{x / count, y / count, std::cos(angle), std::sin(angle), 1e300, -1e300, 0.0};
    for (const std::int32_t i : numbers) {
      const Patch& p = patches[index(i)];
      const double half = 0.5 * (std::abs(s.axis_x) * (p.x_max - p.x_min) +
                                 std::abs(s.axis_y) * (p.y_max - p.y_min));
      const double middle = 0.5 * (s.axis_x * (double{p.x_min} + p.x_max) +
                                   s.axis_y * (double{p.y_min} + p.y_max));
      s.from = std::min(s.from, middle - half);
      s.to = std::max(s.to, middle + half);
      s.radius2 = std::max(s.radius2, farthest2(p, s.x, s.y));
    }
    return s;
  }

  // The squared distance of the farthest corner of a patch's bounds: no echo is farther.
  static double farthest2(const Patch& p, double x, double y) {
    const double dx = std::max(std::abs(p.x_min - x), std::abs(p.x_max - x));
    const double dy = std::max(std::abs(p.y_min - y), std::abs(p.y_max - y));
    return dx * dx + dy * dy;
  }

  // A squared distance that some echo reaches: each side of the bounds has an echo on it.
  static double reached2(const Patch& p, double x, double y) {
    const double dx = std::max(std::abs(p.x_min - x), std::abs(p.x_max - x));
    const double dy = std::max(std::abs(p.y_min - y), std::abs(p.y_max - y));
    const double beside_x = std::max({0.0, p.x_min - x, x - p.x_max});
    const double beside_y = std::max({0.0, p.y_min - y, y - p.y_max});
    return std::max(dx * dx + beside_y * beside_y, dy * dy + beside_x * beside_x);
  }

  // Makes one circle, or halves the patches across their longest extent until each half fits.
  void cut(const std::vector<Patch>& patches, Numbers numbers, double longest) {
    const Shape s = shape(patches, numbers);
    if (numbers.size() == 1 || (s.to - s.from <= longest && !holds_keel(s))) {
      const auto number = static_cast<std::int32_t>(circles_.size());
      for (const std::int32_t i : numbers) circle_of_[index(i)] = number;
      circles_.push_back({s.x, s.y, 0.0, points(patches, numbers), NONE});
      return;
    }
    const double middle = 0.5 * (s.from + s.to);
    const auto split = std::partition(numbers.begin(), numbers.end(), [&](std::int32_t i) {
      const Patch& p = patches[index(i)];
      return (p.x_sum * s.axis_x + p.y_sum * s.axis_y) / p.count < middle;
    });
    auto half = static_cast<std::size_t>(split - numbers.begin());
    if (half == 0 || half == numbers.size()) half = numbers.size() / 2;
    cut(patches, numbers.first(half), rules_.piece);
    cut(patches, numbers.subspan(half), rules_.piece);
  }

  // Tells the circles from this one on of what object they are pieces.
  void number(std::size_t first, std::int32_t object) {
    for (std::size_t i = first; i < circles_.size(); ++i) circles_[i].cut_from = object;
  }

  bool holds_keel(const Shape& s) const {
    if (!rules_.has_hull) return false;
    const double dx = s.x - std::clamp(s.x, double{rules_.hull_aft}, double{rules_.hull_fore});
    return dx * dx + s.y * s.y < s.radius2;
  }

  // Finds the exact radii; only echoes of patches that could hold the farthest are looked at.
  void measure(const RangeImage& image, const PatchMap& map) {
    const std::vector<Patch>& patches = map.patches();
    for (std::size_t i = 0; i < patches.size(); ++i) {
      if (circle_of_[i] == NONE) continue;
      Circle& circle = circles_[index(circle_of_[i])];
      circle.radius = std::max(circle.radius, reached2(patches[i], circle.x, circle.y));
    }
    outer_.assign(patches.size(), 0);
    for (std::size_t i = 0; i < patches.size(); ++i) {
      if (circle_of_[i] == NONE) continue;
      const Circle& circle = circles_[index(circle_of_[i])];
      outer_[i] = farthest2(patches[i], circle.x, circle.y) >= circle.radius;
    }
    for (Circle& circle : circles_) circle.radius = 0.0;
    for (const Stretch& stretch : map.stretches()) {
      if (!outer_[index(stretch.patch)]) continue;
      Circle& circle = circles_[index(circle_of_[index(stretch.patch)])];
      double farthest2 = circle.radius;
      image.each_between(stretch.first, stretch.last, [&](std::size_t cell) {
        const double dx = image.echo(cell).x - circle.x, dy = image.echo(cell).y - circle.y;
        farthest2 = std::max(farthest2, dx * dx + dy * dy);
      });
      circle.radius = farthest2;
    }
    for (Circle& circle : circles_) circle.radius = std::sqrt(circle.radius);
  }

  CircleRules rules_;
  std::vector<std::int32_t> circle_of_;  // of each patch
  std::vector<std::uint8_t> outer_;      // of each patch: could it hold its circle's farthest echo?
  std::vector<Circle> circles_;
};

}  // namespace twinscrew
