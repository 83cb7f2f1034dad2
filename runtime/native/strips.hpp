// Strips: what one row of beams sees of one object without a break.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "range_image.hpp"

namespace twinscrew {

struct Strip {
  std::int32_t circle;  // the object's
  std::int32_t count;   // [-] echoes
  double x, y;          // [m] their mean, levelled frame B
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

  // circle_of(cell): the circle of an occupied cell, or -1 if it has none.
  template <class CircleOf>
  void operator()(const RangeImage& image, bool wraps, CircleOf circle_of) {
    strips_.clear();
    for (int row = 0; row < image.rows(); ++row) {
      cut(image, row, circle_of);
      if (wraps) {
        close_seam(image.columns());
      } else {
        leave_edges(image.columns());
      }
      for (const Piece& piece : row_) keep(piece);
    }
    std::sort(strips_.begin(), strips_.end(), before);
  }

  // Those of one circle side by side, circles in order.
  const std::vector<Strip>& strips() const { return strips_; }

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
    bool whole;
  };

  // What the next echo is compared with, and the sums so far; made for registers.
  struct Open {
    float x, y;
    std::int32_t circle, count;
    double x_sum, y_sum;
    std::size_t cell;
    int column;
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

  // Cuts a row into pieces. An echo that goes on with the one before is only added up.
  template <class CircleOf>
  void cut(const RangeImage& image, int row, CircleOf circle_of) {
    row_.clear();
    const float gap2 = rules_.gap * rules_.gap;
    Open open{};
    image.each_in_row(row, [&](int column, std::size_t cell) {
      const Echo& echo = image.echo(cell);
      const std::int32_t circle = circle_of(cell);
      if (open.count > 0 && circle == open.circle &&
          squared(echo.x - open.x, echo.y - open.y) < gap2) {
        open = {echo.x, echo.y, circle, open.count + 1, open.x_sum + echo.x, open.y_sum + echo.y,
                cell, column};
        return;
      }
      const End here{echo.x, echo.y, image.range(cell), circle, column};
      const bool whole = open.count == 0 || close(image, open, here);
      row_.push_back({here, here, 0.0, 0.0, 0, whole});
      open = {echo.x, echo.y, circle, 1, echo.x, echo.y, cell, column};
    });
    if (open.count > 0) end(image, open);
  }

  // Ends the last piece where `here` begins; tells whether the begin is the next object's own.
  bool close(const RangeImage& image, const Open& open, const End& here) {
    end(image, open);
    Piece& piece = row_.back();
    const int apart = here.column - piece.last.column;
    piece.whole = piece.whole && !hides(here, piece.last, apart);
    return !hides(piece.last, here, apart);
  }

  void end(const RangeImage& image, const Open& open) {
    Piece& piece = row_.back();
    piece.last = {open.x, open.y, image.range(open.cell), open.circle, open.column};
    piece.x_sum = open.x_sum;
    piece.y_sum = open.y_sum;
    piece.count = open.count;
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
