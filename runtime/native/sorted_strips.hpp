// The strips of a scan, in order, to be searched for those of the next one.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "lanes.hpp"

namespace twinscrew {

using Pair2 = std::array<double, 2>;

// Sorted by x, so that only those nearby are looked at, two at a time.
class SortedStrips {
 public:
  static constexpr std::size_t ROW = 4;  // x, y, length, number of echoes

  struct Strip {
    double x, y, length;  // [m]
  };

  void sort(std::span<const double> rows) {
    order_.clear();
    for (std::size_t row = 0; row + ROW <= rows.size(); row += ROW) {
      if (!std::isnan(rows[row])) order_.push_back(row);  // what is nowhere is near nothing
    }
    std::sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
      return rows[a] != rows[b] ? rows[a] < rows[b] : a < b;
    });
    const std::size_t padded = order_.size() + 1;
    for (auto* column : {&x_, &y_, &length_, &off_}) column->assign(padded, NOWHERE);
    for (std::size_t i = 0; i < order_.size(); ++i) {
      x_[i] = rows[order_[i]];
      y_[i] = rows[order_[i] + 1];
      length_[i] = rows[order_[i] + 2];
    }
  }

  // How far `strip` went if it is the one whose way comes nearest to the `expected`, of those whose
  // lengths differ by no more than `differ`; none if that is off by `search` or more. Of two
  // that are as near the first row is taken.
  std::optional<Pair2> nearest(const Strip& strip, const Pair2& expected, double differ,
                               double search) {
    const auto [begin, end] = window(strip.x - expected[0], search, strip.x, expected[0]);
    Double2 least = both(search * search);
    for (std::size_t i = begin; i < end; i += 2) {
      const Double2 ex = strip.x - load2(&x_[i]) - expected[0];
      const Double2 ey = strip.y - load2(&y_[i]) - expected[1];
      const Double2 off = select(absolute(strip.length - load2(&length_[i])) <= differ,
                                 ex * ex + ey * ey, both(FAR));
      std::memcpy(&off_[i], &off, sizeof off);
      least = lesser(off, least);
    }
    const double nearest = std::min(least[0], least[1]);
    if (!(nearest < search * search)) return {};
    std::size_t found = order_.size();
    for (std::size_t i = begin; i < end; ++i) {
      if (off_[i] != nearest) continue;
      if (found == order_.size() || order_[i] < order_[found]) found = i;
    }
    return Pair2{strip.x - x_[found], strip.y - y_[found]};
  }

 private:
  static constexpr double FAR = std::numeric_limits<double>::infinity();
  static constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();

  // Those with x about a place: a little wider than the search, by more than any rounding.
  std::array<std::size_t, 2> window(double place, double search, double a, double b) const {
    const double wide = search + 1e-9 * (1.0 + search + std::abs(a) + std::abs(b));
    const auto end = x_.begin() + static_cast<std::ptrdiff_t>(order_.size());
    const auto from = std::lower_bound(x_.begin(), end, place - wide);
    const auto to = std::upper_bound(from, end, place + wide);
    return {static_cast<std::size_t>(from - x_.begin()), static_cast<std::size_t>(to - x_.begin())};
  }

  std::vector<std::size_t> order_;              // where each one's row begins
  std::vector<double> x_, y_, length_, off_;  // in that order, and one that is nowhere
};

}  // namespace twinscrew
