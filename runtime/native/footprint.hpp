// Pieces that together have the footprint of a vessel are one vessel.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "groups.hpp"
#include "patches.hpp"

namespace twinscrew {

// From some sides the near hull of a catamaran hides what ties it to the ends of the far one.
struct FootprintRule {
  float length, beam;  // [m] of the greatest vessel that is put together
  float reach;         // [m] greatest gap between two pieces
  float least;         // [m] one of them must be this long: two buoys are no vessel
  int points;          // [-] smaller pieces are left alone
};

class Footprints {
 public:
  Footprints(const FootprintRule& rule, std::size_t patches) : rule_(rule) {
    pieces_.reserve(patches);
    for (std::size_t i = 0; i < ANGLES; ++i) {
      const double angle = std::numbers::pi * static_cast<double>(i) / (2.0 * ANGLES);
      axes_[i] = {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle))};
    }
  }

  // Unites pieces in the map, each at most once. True if any were.
  bool operator()(Groups& groups, PatchMap& map) {
    list(groups, map.patches());
    bool changed = false;
    for (std::size_t i = 0; i < pieces_.size(); ++i) {
      for (std::size_t j = i + 1; j < pieces_.size() && !pieces_[i].taken; ++j) {
        if (pieces_[j].taken || !together(pieces_[i], pieces_[j], groups, map.patches())) continue;
        pieces_[i].taken = pieces_[j].taken = changed = true;
        map.unite(groups[pieces_[i].group][0], groups[pieces_[j].group][0]);
      }
    }
    return changed;
  }

 private:
  static constexpr std::size_t ANGLES = 18;   // over a quarter turn: 5 degrees apart
  static constexpr std::size_t PIECES = 256;  // only the largest are tried
  struct Axis {
    float x, y;
  };
  struct Box {
    float x_min = FAR, x_max = -FAR, y_min = FAR, y_max = -FAR;
  };
  struct Piece {
    Box box;
    std::int64_t points;
    std::size_t group;
    bool taken;
  };
  static constexpr float FAR = std::numeric_limits<float>::max();

  void list(Groups& groups, const std::vector<Patch>& patches) {
    pieces_.clear();
    for (std::size_t group = 0; group < groups.size(); ++group) {
      Piece piece{bounds(groups[group], patches, {1.0F, 0.0F}), 0, group, false};
      for (const std::int32_t p : groups[group]) {
        piece.points += patches[static_cast<std::size_t>(p)].count;
      }
      // What is longer than a vessel both ways cannot be a part of one.
      const float extent = std::max(piece.box.x_max - piece.box.x_min,
                                    piece.box.y_max - piece.box.y_min);
      if (piece.points >= rule_.points && extent <= rule_.length + rule_.beam) {
        pieces_.push_back(piece);
      }
    }
    std::sort(pieces_.begin(), pieces_.end(), [](const Piece& a, const Piece& b) {
      return a.points != b.points ? a.points > b.points : a.group < b.group;
    });
    if (pieces_.size() > PIECES) pieces_.resize(PIECES);
  }

  // Bounds of a group along an axis (as x) and across it (as y).
  static Box bounds(std::span<const std::int32_t> group, const std::vector<Patch>& patches,
                    Axis axis) {
    Box box;
    for (const std::int32_t i : group) {
      const Patch& p = patches[static_cast<std::size_t>(i)];
      const float cx = 0.5F * (p.x_min + p.x_max), cy = 0.5F * (p.y_min + p.y_max);
      const float hx = 0.5F * (p.x_max - p.x_min), hy = 0.5F * (p.y_max - p.y_min);
      const float along = cx * axis.x + cy * axis.y, across = cy * axis.x - cx * axis.y;
      const float half_along = hx * axis.x + hy * axis.y, half_across = hy * axis.x + hx * axis.y;
      box.x_min = std::min(box.x_min, along - half_along);
      box.x_max = std::max(box.x_max, along + half_along);
      box.y_min = std::min(box.y_min, across - half_across);
      box.y_max = std::max(box.y_max, across + half_across);
    }
    return box;
  }

  static float length(const Box& box) {
    return std::max(box.x_max - box.x_min, box.y_max - box.y_min);
  }

  // However a vessel lies, its bounds are no wider than its diagonal; a margin is for rounding.
  bool too_large(const Box& a, const Box& b) const {
    const float x = std::max(a.x_max, b.x_max) - std::min(a.x_min, b.x_min);
    const float y = std::max(a.y_max, b.y_max) - std::min(a.y_min, b.y_min);
    return std::max(x, y) > 1.001F * std::hypot(rule_.length, rule_.beam) + 0.01F;
  }

  bool together(const Piece& a, const Piece& b, Groups& groups,
                const std::vector<Patch>& patches) const {
    const float dx = between(a.box.x_min, a.box.x_max, b.box.x_min, b.box.x_max);
    const float dy = between(a.box.y_min, a.box.y_max, b.box.y_min, b.box.y_max);
    if (!(dx * dx + dy * dy <= rule_.reach * rule_.reach) || too_large(a.box, b.box)) return false;
    float longest = 0.0F;
    bool fits = false;
    for (const Axis& axis : axes_) {
      const Box one = bounds(groups[a.group], patches, axis);
      const Box two = bounds(groups[b.group], patches, axis);
      longest = std::max({longest, length(one), length(two)});
      const float x = std::max(one.x_max, two.x_max) - std::min(one.x_min, two.x_min);
      const float y = std::max(one.y_max, two.y_max) - std::min(one.y_min, two.y_min);
      fits = fits || (std::max(x, y) <= rule_.length && std::min(x, y) <= rule_.beam);
    }
    return fits && longest >= rule_.least;
  }

  FootprintRule rule_;
  std::array<Axis, ANGLES> axes_;
  std::vector<Piece> pieces_;
};

}  // namespace twinscrew
