// How far an object has moved between two scans, from the strips that both of them show.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "sorted_strips.hpp"

namespace twinscrew {

struct ShiftRules {
  double search;   // [m] a strip is looked for this far from where it is expected
  double length;   // [m] the same strip's length may differ by this much
  double spacing;  // [-] and by this share of the distance between its echoes
  double sigma;    // [m] noise of a strip's mean
  double ends;     // [-] and of its ends, as a share of the distance between its echoes
  double robust;   // [-] a strip this many sigmas off counts half
  int pairs;       // [-] fewer say nothing
};

struct Shift {
  int pairs = 0;                  // [-] strips that were found again; 0: nothing is known
  double x = 0.0, y = 0.0;        // [m] how far the centre moved
  double xx = 0.0, xy = 0.0, yy = 0.0;  // [m2] covariance
};

// Finds the rigid motion, (d, turn), that takes the strips of one scan to those of the next: pairs
// by nearness and equal length, then least squares, with less weight for what does not fit; again
// from the better guess. Strips that only one scan shows find no partner and do no harm.
class ShiftFinder {
 public:
  explicit ShiftFinder(const ShiftRules& rules) : rules_(rules) {
    pairs_.reserve(256);
  }

  // before, after: rows of x, y, length, number of echoes. `turn` [rad] is the standard deviation
  // of the turn about `centre` between the two.
  Shift operator()(std::span<const double> before, std::span<const double> after,
                   const Pair2& guess, const Pair2& centre, double turn) {
    Motion motion{guess[0], guess[1], 0.0};
    Shift shift;
    double search = rules_.search;
    before_.sort(before);
    for (int round = 0; round < ROUNDS; ++round, search *= 0.5) {
      pair(after, motion, centre, search);
      if (pairs_.size() < static_cast<std::size_t>(rules_.pairs)) return {};
      for (int pass = 0; pass < PASSES; ++pass) shift = solve(motion, turn);
    }
    return known(shift) ? shift : Shift{};
  }

 private:
  static constexpr int ROUNDS = 3, PASSES = 3;
  struct Motion {
    double x, y, turn;
  };
  struct Pair {
    double x, y;    // [m] where the strip is now, from the centre
    double dx, dy;  // [m] how far it moved
    double weight;  // [1/m2]
  };

  // Numbers near the limits of their type may add up to none.
  static bool known(const Shift& s) {
    return std::isfinite(s.x) && std::isfinite(s.y) && std::isfinite(s.xx + s.xy + s.yy) &&
           s.xx > 0.0 && s.xx * s.yy > s.xy * s.xy;
  }

  // To first order in the turn, a point at r from the centre moves by d + turn x r.
  static Pair2 moved(const Motion& m, double x, double y) {
    return {m.x - m.turn * y, m.y + m.turn * x};
  }

  void pair(std::span<const double> after, const Motion& motion, const Pair2& centre,
            double search) {
    pairs_.clear();
    for (std::size_t a = 0; a + SortedStrips::ROW <= after.size(); a += SortedStrips::ROW) {
      const double x = after[a] - centre[0], y = after[a + 1] - centre[1];
      const double spacing = after[a + 2] / std::max(after[a + 3] - 1.0, 1.0);
      const double differ = rules_.length + rules_.spacing * spacing;
      const auto found = before_.nearest({after[a], after[a + 1], after[a + 2]},
                                         moved(motion, x, y), differ, search);
      if (!found) continue;
      const double ends = rules_.ends * spacing;
      const double weight = 1.0 / (rules_.sigma * rules_.sigma + ends * ends);
      if (weight > 0.0) pairs_.push_back({x, y, (*found)[0], (*found)[1], weight});
    }
  }

  // One Gauss-Newton step with Cauchy weights from the last motion.
  Shift solve(Motion& motion, double turn) const {
    double w = 0.0, wx = 0.0, wy = 0.0, wr = 1.0 / (turn * turn), gx = 0.0, gy = 0.0, gr = 0.0;
    for (const Pair& p : pairs_) {
      const Pair2 d = moved(motion, p.x, p.y);
      const double off = (p.dx - d[0]) * (p.dx - d[0]) + (p.dy - d[1]) * (p.dy - d[1]);
      const double k = p.weight / (1.0 + off * p.weight / (rules_.robust * rules_.robust));
      w += k;
      wx += k * p.x;
      wy += k * p.y;
      wr += k * (p.x * p.x + p.y * p.y);
      gx += k * p.dx;
      gy += k * p.dy;
      gr += k * (p.x * p.dy - p.y * p.dx);
    }
    // Normal equations [w 0 -wy; 0 w wx; -wy wx wr] (x, y, turn) = g, by the Schur complement.
    const double schur = wr - (wx * wx + wy * wy) / w;
    motion.turn = (gr + (wy * gx - wx * gy) / w) / schur;
    motion.x = (gx + wy * motion.turn) / w;
    motion.y = (gy - wx * motion.turn) / w;
    const double u = wy / w, v = -wx / w;
    return {static_cast<int>(pairs_.size()), motion.x, motion.y, 1.0 / w + u * u / schur,
            u * v / schur, 1.0 / w + v * v / schur};
  }

  ShiftRules rules_;
  SortedStrips before_;
  std::vector<Pair> pairs_;
};

}  // namespace twinscrew
