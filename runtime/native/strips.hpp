// Strips: what one row of beams sees of one object without a break.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "circles.hpp"
#include "patches.hpp"
#include "range_image.hpp"

namespace twinscrew {

struct Strip {
  std::int32_t circle;  // the object's
  std::int32_t count;   // [-] echoes
  double x, y;          // [m] their mean, levelled frame L
  double length;        // [m] from the first to the last
};

struct StripRules {
  float gap = 0.3F;  // [m] echoes farther apart are not of one strip
  float far = 0.0F;  // [m] a strip that ends at this range may go on where nothing is looked at
};

// A strip both of whose ends are the object's own: such a strip goes where the object goes.
class Strips {
 public:
  Strips(const StripRules& rules, std::size_t cells) : rules_(rules) {
    strips_.reserve(cells / 2);
    row_.reserve(cells);
  }

  // Those of one circle side by side, circles in order.
  const std::vector<Strip>& operator()(const RangeImage& image, const PatchMap& map,
                                       const Circles& circles, bool wraps) {
    strips_.clear();
    for (int row = 0; row < image.rows(); ++row) {
      cut(image, row, map, circles);
      if (wraps) {
        close_seam(image.columns());
      } else {
        leave_edges(image.columns());
      }
      for (const Piece& piece : row_) keep(piece);
    }
    std::sort(strips_.begin(), strips_.end(), before);
    return strips_;
  }

 private:
  struct End {
    float x, y, range;
    std::int32_t circle;
    int column;
  };
  struct Piece {
    End first, last;
    double x_sum, y_sum;
    std::int32_t count;
    bool whole, exact;
  };

  static float squared(float dx, float dy) { return dx * dx + dy * dy; }
  static float squared(const End& a, const End& b) { return squared(b.x - a.x, b.y - a.y); }

  bool one(const End& a, const End& b) const {
    return a.circle == b.circle && squared(a, b) < rules_.gap * rules_.gap;
  }

  // Does what stands beside b, `apart` columns off, hide where b's strip would go on?
  bool hides(const End& a, const End& b, int apart) const {
    return apart <= 2 && a.circle != b.circle && a.range < b.range + rules_.gap;
  }

  // Joins a row's stretches to pieces of one circle without a break.
  void cut(const RangeImage& image, int row, const PatchMap& map, const Circles& circles) {
    row_.clear();
    const std::size_t begin = image.cell(row, 0);
    const auto end = [&](std::size_t cell, std::int32_t circle) -> End {
      const Echo& echo = image.echo(cell);
      return {echo.x, echo.y, image.range(cell), circle, static_cast<int>(cell - begin)};
    };
    for (const Stretch& s : map.stretches(row)) {
      const std::int32_t circle = circles.circle_of(s);
      if (s.joined && row_.back().last.circle == circle) {
        Piece& piece = row_.back();
        piece.last = end(s.last, circle);
        piece.x_sum += s.x_sum;
        piece.y_sum += s.y_sum;
        piece.count += s.count;
        piece.exact = piece.exact && s.exact;
        continue;
      }
      Piece next{end(s.first, circle), end(s.last, circle), s.x_sum, s.y_sum, s.count, true, s.exact};
      if (!row_.empty()) {
        Piece& piece = row_.back();
        const int apart = next.first.column - piece.last.column;
        piece.whole = piece.whole && !hides(next.first, piece.last, apart);
        next.whole = !hides(piece.last, next.first, apart);
      }
      row_.push_back(next);
    }
    for (Piece& piece : row_) {
      if (!piece.exact) add_up(image, begin, piece);
    }
  }

  // Sums an inexact piece up echo by echo, so that the result does not depend on its stretches.
  static void add_up(const RangeImage& image, std::size_t begin, Piece& piece) {
    piece.x_sum = piece.y_sum = 0.0;
    const auto cell = [&](const End& end) { return begin + static_cast<std::size_t>(end.column); };
    image.each_between(cell(piece.first), cell(piece.last), [&](std::size_t at) {
      piece.x_sum += image.echo(at).x;
      piece.y_sum += image.echo(at).y;
    });
  }

  // The last column of a full turn is beside the first.
  void close_seam(int columns) {
    if (row_.size() < 2) return;
    Piece &begin = row_.front(), &end = row_.back();
    const int apart = begin.first.column + columns - end.last.column;
    if (!one(end.last, begin.first)) {
      end.whole = end.whole && !hides(begin.first, end.last, apart);
      begin.whole = begin.whole && !hides(end.last, begin.first, apart);
      return;
    }
    end.last = begin.last;
    end.x_sum += begin.x_sum;
    end.y_sum += begin.y_sum;
    end.count += begin.count;
    end.whole = end.whole && begin.whole;
    begin.whole = false;
  }

  // What ends where the image ends may go on where nothing is looked at.
  void leave_edges(int columns) {
    if (row_.empty()) return;
    if (row_.front().first.column == 0) row_.front().whole = false;
    if (row_.back().last.column == columns - 1) row_.back().whole = false;
  }

  void keep(const Piece& piece) {
    if (!piece.whole || piece.count < 2 || piece.first.circle < 0) return;
    if (std::max(piece.first.range, piece.last.range) > rules_.far) return;
    strips_.push_back({piece.first.circle, piece.count, piece.x_sum / piece.count,
                       piece.y_sum / piece.count,
                       std::sqrt(double{squared(piece.first, piece.last)})});
  }

  // A total order: the answer does not depend on the sort.
  static bool before(const Strip& a, const Strip& b) {
    if (a.circle != b.circle) return a.circle < b.circle;
    if (a.x != b.x) return a.x < b.x;
    return a.y != b.y ? a.y < b.y : a.length < b.length;
  }

  StripRules rules_;
  std::vector<Piece> row_;
  std::vector<Strip> strips_;
};

}  // namespace twinscrew
