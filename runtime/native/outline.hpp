// The outline: the nearest echo of each sector, whatever its row. Up to there the water is free.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "range_image.hpp"

namespace twinscrew {

class Outline {
 public:
  static constexpr std::size_t NOTHING = static_cast<std::size_t>(-1);

  // A sector is so many columns side by side; the last may have fewer.
  Outline(int columns, int sector)
      : sector_(sector), nearest_(static_cast<std::size_t>((columns + sector - 1) / sector)) {}

  void operator()(const RangeImage& image) {
    std::fill(nearest_.begin(), nearest_.end(), NOTHING);
    for (int row = 0; row < image.rows(); ++row) {
      image.each_in_row(row, [&](int column, std::size_t cell) {
        std::size_t& nearest = nearest_[static_cast<std::size_t>(column / sector_)];
        if (nearest == NOTHING || image.range(cell) < image.range(nearest)) nearest = cell;
      });
    }
  }

  // The cell of each sector's nearest echo, or NOTHING.
  const std::vector<std::size_t>& nearest() const { return nearest_; }

 private:
  int sector_;
  std::vector<std::size_t> nearest_;
};

}  // namespace twinscrew
