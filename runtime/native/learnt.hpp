// What the LiDAR has learnt around the vessel: walls that stand, and water that is free. A square of
// cells that goes along with the vessel; what leaves it is forgotten, so its memory never grows.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "free_water.hpp"
#include "route.hpp"

namespace twinscrew {

struct LearntRules {
  double cell;       // [m] side of a cell
  std::int32_t size; // [-] cells along a side of the square
  int certain;       // [-] a cell is a wall after so many scans have shown it there
  int most;          // [-] and so many more have to show water before it is none
  double margin;     // [m] how deep in free water a wall must lie to be gone
  double height;     // [m] a beam must have passed this far below its top
  double keep_s;     // [s] what nothing has been seen of for longer is forgotten
};

class LearntMap {
 public:
  // One scan's outline, in the levelled frame L of the vessel.
  struct Scan {
    const FreeWater* water;               // null: nothing is asked whether it is gone
    std::span<const double> boundary;     // [m] x, y of each sector's end
    std::span<const double> heights;      // [m] of the echoes there, up; NaN: none
    std::span<const std::int64_t> seen;   // the long object that it ends at, or -1
    std::span<const std::uint8_t> stands; // of each long object
    Place sensor;                         // [m] L
    Place own;                            // [m] N
    double heading;                       // [rad]
    double time;                          // [s]
  };

  explicit LearntMap(const LearntRules& rules)
      : rules_(rules),
        cells_(static_cast<std::size_t>(rules.size) * static_cast<std::size_t>(rules.size)),
        free_(cells_.size(), static_cast<float>(NEVER)) {}

  void reset() {
    std::fill(cells_.begin(), cells_.end(), Cell{});
    std::fill(free_.begin(), free_.end(), static_cast<float>(NEVER));
    begin_ = swept_ = NEVER;
    if (!walls_.empty()) ++version_;
    walls_.clear();
    knows_place_ = false;
  }

  void see(const Scan& scan) {
    follow(scan.own);
    if (std::isnan(begin_)) begin_ = scan.time;
    ++scans_, now_ = scan.time - begin_;
    cosine_ = std::cos(scan.heading), sine_ = std::sin(scan.heading), own_ = scan.own;
    for (std::size_t i = 0; i < scan.heights.size(); ++i) {
      const Place end{scan.boundary[2 * i], scan.boundary[2 * i + 1]};
      const std::int64_t number = scan.seen[i];
      const bool is_wall = number >= 0 && static_cast<std::size_t>(number) < scan.stands.size() &&
                           scan.stands[static_cast<std::size_t>(number)] != 0;
      if (is_wall && !std::isnan(scan.heights[i])) hit(in_N(end), scan.heights[i]);
    }
    if (std::isnan(swept_) || now_ - swept_ >= SWEEP || now_ < swept_) swept_ = now_, sweep(scan);
    if (scan.water != nullptr) review(*scan.water);
  }

  // Changes whenever a wall comes or goes.
  std::uint64_t version() const { return version_; }
  // [-] Cells with some evidence of a wall.
  std::size_t known() const { return walls_.size(); }

  // The walls as segments between the mean echoes of neighbouring cells; a cell without neighbours
  // is a short segment by itself.
  std::vector<Segment> segments() const {
    std::vector<Segment> found;
    constexpr std::array<std::array<std::int32_t, 2>, 4> AHEAD{{{0, 1}, {1, 0}, {1, 1}, {1, -1}}};
    for (const auto& [i, j] : sorted()) {
      const Cell& cell = at(i, j);
      bool is_alone = true;
      const auto stands = [&](std::int32_t k, std::int32_t l) { return holds(k, l) && at(k, l).is_wall; };
      for (std::int32_t k = -1; k <= 1; ++k) {
        for (std::int32_t l = -1; l <= 1; ++l) is_alone &= (k == 0 && l == 0) || !stands(i + k, j + l);
      }
      for (const auto& [k, l] : AHEAD) {
        // Not across a corner that is filled.
        const bool is_cut = k != 0 && l != 0 && (stands(i + k, j) || stands(i, j + l));
        if (stands(i + k, j + l) && !is_cut) found.push_back({place(cell, i, j), place(at(i + k, j + l), i + k, j + l)});
      }
      if (is_alone) {
        const Place p = place(cell, i, j), half{rules_.cell / 4.0, 0.0};
        found.push_back({p - half, p + half});
      }
    }
    return found;
  }

  // [s] When a beam last passed over a place; NaN: never, or that is not known any more.
  double free_at(const Place& p) const {
    const std::int32_t i = row(p.x), j = row(p.y);
    if (!knows_place_ || !holds(i, j)) return NEVER;
    if (at(i, j).is_wall) return NEVER;
    return begin_ + static_cast<double>(free_[index(i, j)]);
  }
  // [s] When a wall there was last seen; NaN: there is none.
  double wall_at(const Place& p) const {
    const std::int32_t i = row(p.x), j = row(p.y);
    if (!knows_place_ || !holds(i, j) || !at(i, j).is_wall) return NEVER;
    return begin_ + at(i, j).seen_s;
  }

 private:
  static constexpr double SWEEP = 0.5 - 1e-6;  // [s] water that is looked over is noted twice a second
  static constexpr double NEVER = std::numeric_limits<double>::quiet_NaN();
  struct Cell {
    float x = 0.0F, y = 0.0F;  // [m] mean of the echoes, from the cell's corner
    float top = -1e9F;         // [m] of the highest echo
    int evidence = 0;          // scans that showed a wall, less those that showed water
    double seen_s = 0.0;     // [s]
    std::uint64_t scan = 0;  // the last one that showed a wall here
    bool is_wall = false, is_listed = false;
  };
  struct At {
    std::int32_t i, j;
  };

  Place in_N(const Place& p) const {
    return own_ + Place{cosine_ * p.x - sine_ * p.y, sine_ * p.x + cosine_ * p.y};
  }
  Place in_L(const Place& p) const {
    const Place off = p - own_;
    return {cosine_ * off.x + sine_ * off.y, cosine_ * off.y - sine_ * off.x};
  }

  std::int32_t row(double metres) const {
    return static_cast<std::int32_t>(std::floor(std::clamp(metres / rules_.cell, -1e9, 1e9)));
  }
  bool holds(std::int32_t i, std::int32_t j) const {
    const std::int32_t half = rules_.size / 2;
    return i >= north_ - half && i < north_ + half && j >= east_ - half && j < east_ + half;
  }
  std::size_t index(std::int32_t i, std::int32_t j) const {
    const auto wrap = [n = rules_.size](std::int32_t k) { return static_cast<std::size_t>(((k % n) + n) % n); };
    return wrap(i) * static_cast<std::size_t>(rules_.size) + wrap(j);
  }
  Cell& at(std::int32_t i, std::int32_t j) { return cells_[index(i, j)]; }
  const Cell& at(std::int32_t i, std::int32_t j) const { return cells_[index(i, j)]; }
  Place place(const Cell& cell, std::int32_t i, std::int32_t j) const {
    return {i * rules_.cell + static_cast<double>(cell.x), j * rules_.cell + static_cast<double>(cell.y)};
  }

  // Moves the square when the vessel has gone an eighth of it, and forgets what leaves it.
  void follow(const Place& own) {
    const std::int32_t i = row(own.x), j = row(own.y), far = rules_.size / 8;
    if (knows_place_ && std::abs(i - north_) <= far && std::abs(j - east_) <= far) return;
    if (!knows_place_) {
      north_ = i, east_ = j, knows_place_ = true;
      return;
    }
    const std::int32_t n0 = north_, e0 = east_, half = rules_.size / 2;
    north_ = i, east_ = j;
    bool lost = false;
    for (std::int32_t k = n0 - half; k < n0 + half; ++k) {
      for (std::int32_t l = e0 - half; l < e0 + half; ++l) {
        if (holds(k, l)) continue;
        Cell& cell = at(k, l);
        lost |= cell.is_wall;
        cell = Cell{};
        free_[index(k, l)] = static_cast<float>(NEVER);
      }
    }
    std::erase_if(walls_, [&](const At& w) { return !holds(w.i, w.j); });
    if (lost) ++version_;
  }

  void hit(const Place& p, double top) {
    const std::int32_t i = row(p.x), j = row(p.y);
    if (!holds(i, j)) return;
    Cell& cell = at(i, j);
    const auto x = static_cast<float>(p.x - i * rules_.cell), y = static_cast<float>(p.y - j * rules_.cell);
    const float share = cell.evidence > 0 ? 0.2F : 1.0F;
    cell.x += share * (x - cell.x), cell.y += share * (y - cell.y);
    cell.top = std::max(cell.top, static_cast<float>(top));
    cell.seen_s = now_;
    if (cell.scan != scans_) cell.evidence = std::min(cell.evidence + 1, rules_.most);
    cell.scan = scans_;
    if (!cell.is_listed) cell.is_listed = true, walls_.push_back({i, j});
    if (!cell.is_wall && cell.evidence >= rules_.certain) cell.is_wall = true, ++version_;
  }

  // Marks the water that was looked over. Lines of sight side by side that are nowhere farther apart
  // than cells are wide mark the same cells: one of them will do.
  void sweep(const Scan& scan) {
    const Place from = in_N(scan.sensor);
    Place last = scan.sensor;
    for (std::size_t i = 0; i < scan.heights.size(); ++i) {
      const Place end{scan.boundary[2 * i], scan.boundary[2 * i + 1]};
      const Place way = end - scan.sensor, before = last - scan.sensor;
      const double length = norm(way), other = norm(before);
      const bool is_beside = std::fabs(cross(way, before)) < 0.7 * rules_.cell * std::min(length, other) &&
                             dot(way, before) > 0.0;
      if (is_beside && length <= other + rules_.cell) continue;
      last = end;
      pass(from, in_N(end));
    }
  }

  void pass(const Place& from, const Place& to) {
    const Place way = to - from;
    const double length = norm(way) - rules_.margin;
    if (!(length > 0.0)) return;
    const double north = way.x / norm(way), east = way.y / norm(way);
    for (double done = 0.0; done < length; done += rules_.cell) {
      const std::int32_t i = row(from.x + done * north), j = row(from.y + done * east);
      if (!holds(i, j)) return;
      free_[index(i, j)] = static_cast<float>(now_);
    }
  }

  // Asks of each wall that this scan did not show whether it showed water in its place.
  void review(const FreeWater& water) {
    bool changed = false;
    std::erase_if(walls_, [&](const At& w) {
      Cell& cell = at(w.i, w.j);
      if (cell.scan == scans_) return false;
      const Place p = in_L(place(cell, w.i, w.j));
      const auto known = water.ask(p.x, p.y, static_cast<double>(cell.top) - rules_.height, rules_.margin);
      if (known.answer == FreeWater::FREE) --cell.evidence;
      if (cell.evidence > 0 && now_ - cell.seen_s <= rules_.keep_s) return false;
      changed |= cell.is_wall;
      cell = Cell{};
      return true;
    });
    if (changed) ++version_;
  }

  // The walls in the order of their places: what is made of them is the same however they came.
  std::vector<std::array<std::int32_t, 2>> sorted() const {
    std::vector<std::array<std::int32_t, 2>> places;
    for (const auto& [i, j] : walls_) {
      if (at(i, j).is_wall) places.push_back({i, j});
    }
    std::sort(places.begin(), places.end());
    return places;
  }

  LearntRules rules_;
  std::vector<Cell> cells_;
  std::vector<float> free_;  // [s] since the first scan: when each cell was last looked over
  std::vector<At> walls_;  // cells with evidence of a wall
  std::int32_t north_ = 0, east_ = 0;
  bool knows_place_ = false;
  std::uint64_t scans_ = 0, version_ = 0;
  double begin_ = NEVER, swept_ = NEVER, now_ = 0.0, cosine_ = 1.0, sine_ = 0.0;
  Place own_;
};

}  // namespace twinscrew
