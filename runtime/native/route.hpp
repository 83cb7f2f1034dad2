// The cheapest way around what is fixed. Water is divided into square cells, the finer the nearer to
// a wall (a quadtree); each cell knows the walls that can be nearest to its points, so that the
// clearance of any point, and of any leg, is exact. Water is divided finely only where somebody
// asks. A* runs over the cells and pulls its legs taut as it goes (Theta*: Daniel, Nash, Koenig,
// Felner 2010). Laws: tests/property/test_route.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <iterator>
#include <limits>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "segment.hpp"

namespace twinscrew {

struct RouteRules {
  double least;      // [m] no leg is nearer to a wall
  double wanted;     // [m] from here on nearness costs nothing
  double nearness;   // [-] a metre at the least clearance costs 1 + this
  double finest;     // [m] side of the smallest cell
  double coarsest;   // [m] side of the largest cell
  double drift_s;    // [s] a wall to leeward counts as nearer by this times the drift
  double escape;     // [m] a start or goal that is too near to a wall may be this far from clear water
  std::size_t most;  // [-] cells; more are not made
};

enum class RouteEnd : int { FOUND, START_SHUT_IN, GOAL_SHUT_IN, NO_WAY, TOO_FINE };

struct Route {
  RouteEnd end = RouteEnd::NO_WAY;
  std::vector<Place> places;  // from the start to the goal
  double cost = 0.0;          // [m] as if all were open water
  std::size_t expanded = 0;   // [-] cells
};

class RoutePlanner {
 public:
  explicit RoutePlanner(const RouteRules& rules) : rules_(rules) {}

  // Divides a square of water. `shores` are the whole boundary of what is forbidden, which lies to
  // the left of each; `walls` have water on both sides.
  void divide(std::span<const Segment> shores, std::span<const Segment> walls, const Place& low,
              double side) {
    segments_.assign(shores.begin(), shores.end());
    sort_rays(shores.size());
    segments_.insert(segments_.end(), walls.begin(), walls.end());
    root_side_ = top_side_ = rules_.finest;
    while (root_side_ < side) root_side_ *= 2.0;
    const double coarsest = std::max(rules_.coarsest, root_side_ / 128.0);
    while (top_side_ * 2.0 <= coarsest && top_side_ < root_side_) top_side_ *= 2.0;
    low_ = low;
    top_count_ = static_cast<std::size_t>(std::llround(root_side_ / top_side_));
    cells_.clear(), candidates_.clear(), visits_.clear();
    cells_.reserve(rules_.most + top_count_ * top_count_);  // so that none is ever moved
    cells_.resize(top_count_ * top_count_);
    is_too_fine_ = false;
    std::vector<std::int32_t> all;
    const Place middle = low + Place{root_side_ / 2.0, root_side_ / 2.0};
    const double reach = root_side_ * ROOT2 / 2.0 + rules_.wanted;
    for (std::size_t i = 0; i < segments_.size(); ++i) {
      if (segments_[i].distance2(middle) <= reach * reach) all.push_back(static_cast<std::int32_t>(i));
    }
    part({middle, root_side_}, all, 0);
  }

  // [-] Cells so far.
  std::size_t size() const { return cells_.size(); }
  bool covers(const Place& p) const {
    const Place q = p - low_;
    return q.x >= 0.0 && q.y >= 0.0 && q.x < root_side_ && q.y < root_side_;
  }

  // [m] To the nearest wall; 0 where it is forbidden, and outside the square.
  double clearance(const Place& p) {
    if (!covers(p)) return 0.0;
    const Cell& cell = cells_[leaf(p)];
    if (is_forbidden(cell, p)) return 0.0;
    return near(cell, p).distance;
  }

  // [m] The least clearance along a leg.
  double clearance(const Place& a, const Place& b) {
    double least = std::min(clearance(a), clearance(b));
    walk(a, b, [&](const Cell& cell, const Segment& part, double) {
      if (cell.is_inside) least = 0.0;
      for (const std::int32_t i : around(cell)) {
        least = std::min(least, std::sqrt(segments_[static_cast<std::size_t>(i)].distance2(part)));
      }
      return least > 0.0;
    });
    return least;
  }

  // [m] What a leg costs; infinite if it comes too near to a wall, or costs more than `most`.
  double leg(const Place& a, const Place& b, double most = INFINITE) {
    if (!covers(a) || !covers(b)) return INFINITE;
    double cost = 0.0;
    const bool passes = walk(a, b, [&](Cell& cell, const Segment& part, double length) {
      if (cell.is_inside) return false;
      if (cell.clearance - cell.side * (ROOT2 / 2.0) < rules_.least) {
        for (const std::int32_t i : around(cell)) {
          if (segments_[static_cast<std::size_t>(i)].distance2(part) < rules_.least * rules_.least) {
            return false;
          }
        }
      }
      cost += length * weight(near(cell, 0.5 * (part.a + part.b)));
      return cost <= most;
    });
    return passes ? cost : INFINITE;
  }

  // The way from start to goal; pushed by wind and current at `drift` [m/s].
  Route find(const Place& start, const Place& goal, const Place& drift) {
    if (drift.x != drift_.x || drift.y != drift_.y) {
      drift_ = drift;
      for (Cell& cell : cells_) cell.weight = 0.0;
    }
    Route route;
    if (!covers(start) || !covers(goal)) return route;
    const double straight = norm(goal - start);
    if (leg(start, goal, straight * (1.0 + 1e-9)) < INFINITE) {
      route.end = RouteEnd::FOUND, route.places = {start, goal}, route.cost = straight;
      return route;
    }
    begin(start, goal);
    bool can_begin = false, can_end = false;
    for (const auto& [id, cost] : links(start)) {
      can_begin = true;
      reach(id, START, cost);
    }
    for (const auto& [id, cost] : links(goal)) {
      can_end = true;
      visit(id).to_goal = cost;
    }
    if (!can_begin) route.end = RouteEnd::START_SHUT_IN;
    if (can_begin && !can_end) route.end = RouteEnd::GOAL_SHUT_IN;
    if (can_begin && can_end) search(route);
    if (is_too_fine_) route.end = RouteEnd::TOO_FINE;
    if (route.end != RouteEnd::FOUND) return route;
    for (std::size_t id = GOAL; id != NOBODY; id = visit(id).from) route.places.push_back(at(id));
    std::reverse(route.places.begin(), route.places.end());
    tauten(route.places);
    for (std::size_t i = 1; i < route.places.size(); ++i) {
      const double cost = leg(route.places[i - 1], route.places[i]);
      const double length = norm(route.places[i] - route.places[i - 1]);
      route.cost += cost < INFINITE ? cost : (1.0 + rules_.nearness) * length;
    }
    return route;
  }

  static constexpr double INFINITE = std::numeric_limits<double>::infinity();

 private:
  static constexpr double ROOT2 = 1.4142135623730951;
  static constexpr double FINER = 1.0;  // [-] a cell's side is at most this share of its clearance
  static constexpr std::size_t NOBODY = static_cast<std::size_t>(-1), START = NOBODY - 1, GOAL = NOBODY - 2;
  static constexpr std::size_t RAYS = 256;

  struct Cell {
    Place middle;
    double side = 0.0;
    double clearance = 0.0;              // [m] of the middle
    double weight = 0.0;                 // [-] what a metre costs; 0: not known yet
    std::int32_t children = -1;          // the first of four; -1: a leaf
    std::uint32_t begin = 0, count = 0;  // of its walls among the candidates
    bool is_open = false;    // false: a top cell that is not divided yet
    bool is_inside = false;  // all of it is forbidden
    bool is_mixed = false;   // a part of it may be
    bool is_free = false;    // its middle has the least clearance
  };
  struct Near {
    double distance = INFINITE;
    Place to;  // [m] from the point to the wall
  };
  struct Visit {
    double cost = INFINITE, to_goal = INFINITE;  // [m]
    std::size_t from = NOBODY;
    std::uint32_t search = 0;
    bool is_done = false;
  };
  struct Entry {
    double total;  // [m]
    Place middle;
    std::size_t id;
  };

  // Equal costs are told apart by places, so that it does not matter when cells were made.
  static bool later(const Entry& a, const Entry& b) {
    return std::tie(a.total, a.middle.x, a.middle.y) > std::tie(b.total, b.middle.x, b.middle.y);
  }

  // -- The cells.

  // Gives each top cell the walls that can be nearest to its points.
  void part(const Cell& cell, const std::vector<std::int32_t>& above, int depth) {
    const std::vector<std::int32_t>& mine = nearest(cell, above, depth).second;
    if (cell.side <= top_side_ * (1.0 + 1e-9)) {
      Cell& top = cells_[top_index(cell.middle)];
      top = cell;
      top.begin = static_cast<std::uint32_t>(candidates_.size());
      top.count = static_cast<std::uint32_t>(mine.size());
      candidates_.insert(candidates_.end(), mine.begin(), mine.end());
      return;
    }
    for (int k = 0; k < 4; ++k) part(quarter(cell, k), mine, depth + 1);
  }

  static Cell quarter(const Cell& cell, int k) {
    const double off = cell.side / 4.0;
    return {cell.middle + Place{k & 1 ? off : -off, k & 2 ? off : -off}, cell.side / 2.0};
  }

  // [m] The distance from a cell's middle to the nearest wall, and the walls that can be nearest to
  // any of its points.
  std::pair<double, std::vector<std::int32_t>&> nearest(const Cell& cell,
                                                        std::span<const std::int32_t> above,
                                                        int depth) {
    std::vector<std::int32_t>& mine = kept(depth);
    mine.clear();
    distances_.resize(above.size());
    double least = INFINITE;
    for (std::size_t i = 0; i < above.size(); ++i) {
      const Segment& segment = segments_[static_cast<std::size_t>(above[i])];
      distances_[i] = std::sqrt(segment.distance2(cell.middle));
      least = std::min(least, distances_[i]);
    }
    for (std::size_t i = 0; i < above.size(); ++i) {
      if (distances_[i] <= least + ROOT2 * cell.side) mine.push_back(above[i]);
    }
    return {least, mine};
  }

  // Divides a cell until each part is either all too near to a wall, or all clear and not large for
  // its clearance, or as small as cells get.
  void split(std::size_t id, std::span<const std::int32_t> above, int depth) {
    Cell& cell = cells_[id];
    const auto [least, mine] = nearest(cell, above, depth);
    const bool inside = is_inside(cell.middle);
    const double half = cell.side * ROOT2 / 2.0, clear = inside ? -least : least;
    // None of a cell's points has a clearance that differs from the middle's by more than `half`.
    const bool is_shut = clear + half < rules_.least;
    const bool is_clear = clear - half >= rules_.least && cell.side <= FINER * clear;
    cell.is_open = true;
    cell.clearance = least;
    cell.is_mixed = least <= half;
    if (is_shut || is_clear || cell.side <= rules_.finest * (1.0 + 1e-9)) {
      cell.is_inside = inside && !cell.is_mixed;
      cell.is_free = clear >= rules_.least;
      cell.begin = static_cast<std::uint32_t>(candidates_.size());
      cell.count = static_cast<std::uint32_t>(mine.size());
      candidates_.insert(candidates_.end(), mine.begin(), mine.end());
      return;
    }
    if (cells_.size() + 4 > cells_.capacity()) {
      is_too_fine_ = true;  // and this one is forbidden
      cell.is_inside = true;
      return;
    }
    cell.children = static_cast<std::int32_t>(cells_.size());
    for (int k = 0; k < 4; ++k) cells_.push_back(quarter(cell, k));
    for (std::size_t k = 0; k < 4; ++k) {
      split(static_cast<std::size_t>(cell.children) + k, mine, depth + 1);
    }
  }

  // The lists of the cells that are being divided: one a depth, used again and again.
  std::vector<std::int32_t>& kept(int depth) {
    const auto d = static_cast<std::size_t>(depth);
    while (lists_.size() <= d) lists_.emplace_back();
    return lists_[d];
  }

  std::size_t top_index(const Place& p) const {
    const auto place = [&](double real) {
      const double share = real / top_side_;
      return share > 0.0 ? std::min(static_cast<std::size_t>(share), top_count_ - 1) : 0;
    };
    return place(p.x - low_.x) + top_count_ * place(p.y - low_.y);
  }

  std::size_t leaf(const Place& p) {
    std::size_t id = top_index(p);
    if (!cells_[id].is_open) {
      const std::vector<std::int32_t> mine(around(cells_[id]).begin(), around(cells_[id]).end());
      split(id, mine, 0);
    }
    while (cells_[id].children >= 0) {
      const Cell& cell = cells_[id];
      const int k = (p.x >= cell.middle.x ? 1 : 0) | (p.y >= cell.middle.y ? 2 : 0);
      id = static_cast<std::size_t>(cell.children + k);
    }
    return id;
  }

  // Rays go along x: those segments that cross a ray's y, by strips of y.
  void sort_rays(std::size_t shores) {
    rays_.assign(RAYS, {});
    ray_low_ = INFINITE;
    double high = -INFINITE;
    for (std::size_t i = 0; i < shores; ++i) {
      ray_low_ = std::min({ray_low_, segments_[i].a.y, segments_[i].b.y});
      high = std::max({high, segments_[i].a.y, segments_[i].b.y});
    }
    ray_width_ = std::max((high - ray_low_) / static_cast<double>(RAYS), 1e-9);
    double area = 0.0;
    for (std::size_t i = 0; i < shores; ++i) area += cross(segments_[i].a, segments_[i].b);
    is_bounded_ = !(area < 0.0);  // else all is forbidden but what the shores enclose
    for (std::size_t i = 0; i < shores; ++i) {
      const auto [low, up] = std::minmax(segments_[i].a.y, segments_[i].b.y);
      for (std::size_t r = ray(low); r <= ray(up); ++r) rays_[r].push_back(static_cast<std::int32_t>(i));
    }
  }
  std::size_t ray(double y) const {
    const double real = (y - ray_low_) / ray_width_;
    return real > 0.0 ? std::min(static_cast<std::size_t>(real), RAYS - 1) : 0;
  }
  bool is_inside(const Place& p) const {
    bool inside = !is_bounded_;
    if (!(p.y >= ray_low_)) return inside;
    for (const std::int32_t i : rays_[ray(p.y)]) {
      const auto& [a, b] = segments_[static_cast<std::size_t>(i)];
      if ((a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)) {
        inside = !inside;
      }
    }
    return inside;
  }

  std::span<const std::int32_t> around(const Cell& cell) const {
    return {candidates_.data() + cell.begin, cell.count};
  }

  Near near(const Cell& cell, const Place& p) const {
    Near found;
    double least = INFINITE;
    for (const std::int32_t i : around(cell)) {
      const Place off = segments_[static_cast<std::size_t>(i)].nearest(p) - p;
      const double d2 = dot(off, off);
      if (d2 < least) least = d2, found.to = off;
    }
    found.distance = std::sqrt(least);
    return found;
  }

  bool is_forbidden(const Cell& cell, const Place& p) const {
    return cell.is_inside || (cell.is_mixed && is_inside(p));
  }

  // [-] What a metre costs in a cell. A wall to leeward is as near as it will be after `drift_s`.
  double weight(Cell& cell) {
    if (cell.weight == 0.0) cell.weight = weight(near(cell, cell.middle));
    return cell.weight;
  }
  double weight(const Near& at) const {
    double clear = at.distance;
    if (clear > 0.0 && clear < INFINITE) {
      clear -= rules_.drift_s * std::max(dot(drift_, at.to) / clear, 0.0);
    }
    const double near = std::clamp((rules_.wanted - clear) / (rules_.wanted - rules_.least), 0.0, 1.0);
    return 1.0 + rules_.nearness * near * near;
  }

  // Calls `see(cell, part, length)` for each part of a leg, none longer than its cell allows, until
  // that gives false. In open water one part spans many cells: as many as its first one's clearance.
  template <class See>
  bool walk(const Place& a, const Place& b, See see) {
    const double length = norm(b - a);
    const Place along = length > 0.0 ? (1.0 / length) * (b - a) : Place{};
    const double free = rules_.wanted + rules_.drift_s * norm(drift_);
    double done = 0.0;
    do {
      const Place p = a + done * along;
      if (!covers(p)) return false;
      Cell& cell = cells_[leaf(p + 1e-7 * along)];
      double step = std::max(exit(cell, p, along), 1e-6);
      const double open = cell.clearance - norm(p - cell.middle) - free;
      if (!cell.is_inside && open > step) step = open;
      step = std::min(step, length - done);
      if (!see(cell, Segment{p, p + step * along}, step)) return false;
      done += step;
    } while (done < length - 1e-9);
    return true;
  }

  // [m] How far it is from a point out of a cell.
  static double exit(const Cell& cell, const Place& p, const Place& along) {
    const double half = cell.side / 2.0;
    const auto way = [half](double off, double speed) {
      if (std::fabs(speed) < 1e-7) return INFINITE;  // along the cell's side
      return ((speed > 0.0 ? half : -half) - off) / speed;
    };
    return std::min(way(p.x - cell.middle.x, along.x), way(p.y - cell.middle.y, along.y)) + 1e-7;
  }

  template <class Each>
  void neighbours(std::size_t id, Each each) {
    const Cell& cell = cells_[id];
    const double half = cell.side / 2.0, out = half + rules_.finest / 4.0;
    for (int side = 0; side < 4; ++side) {
      // Along each side from corner to corner, the corner at its end included.
      double along = rules_.finest / 8.0 - half;
      while (along < out) {
        const Place off = side == 0   ? Place{along, -out}
                          : side == 1 ? Place{out, along}
                          : side == 2 ? Place{-along, out}
                                      : Place{-out, -along};
        const Place p = cell.middle + off;
        double next = along + rules_.finest;
        if (covers(p)) {
          const std::size_t other = leaf(p);
          each(other);
          const Cell& o = cells_[other];
          const Place to = o.middle - cell.middle;
          const double centre = side == 0 ? to.x : side == 1 ? to.y : side == 2 ? -to.x : -to.y;
          next = std::max(next, centre + o.side / 2.0 + rules_.finest / 4.0);
        }
        along = along < half && next >= half ? half + rules_.finest / 8.0 : next;
      }
    }
  }

  // -- The search.

  void begin(const Place& start, const Place& goal) {
    ++search_;
    heap_.clear();
    start_ = start, goal_ = goal, at_start_ = at_goal_ = {};
    at_start_.cost = 0.0, at_start_.is_done = true;
    at_start_.search = at_goal_.search = search_;
  }

  void search(Route& route) {
    reach(GOAL, START, leg(start_, goal_));
    while (!heap_.empty()) {
      std::pop_heap(heap_.begin(), heap_.end(), later);
      const std::size_t id = heap_.back().id;
      heap_.pop_back();
      if (visit(id).is_done) continue;
      visit(id).is_done = true;
      if (id == GOAL) {
        route.end = RouteEnd::FOUND;
        return;
      }
      ++route.expanded;
      pull(id);
      expand(id);
    }
  }

  Visit& visit(std::size_t id) {
    if (id == START) return at_start_;
    if (id == GOAL) return at_goal_;
    if (id >= visits_.size()) visits_.resize(cells_.size());
    Visit& found = visits_[id];
    if (found.search != search_) found = {}, found.search = search_;
    return found;
  }

  Place at(std::size_t id) const {
    return id == START ? start_ : id == GOAL ? goal_ : cells_[id].middle;
  }

  void reach(std::size_t id, std::size_t from, double cost) {
    const double both = visit(from).cost + cost;
    Visit& to = visit(id);
    if (!(both < to.cost)) return;
    to.cost = both, to.from = from;
    heap_.push_back({both + norm(goal_ - at(id)), at(id), id});
    std::push_heap(heap_.begin(), heap_.end(), later);
  }

  // Goes straight from the place before the last one, where that is cheaper.
  void pull(std::size_t id) {
    const std::size_t last = visit(id).from, before = last == NOBODY ? NOBODY : visit(last).from;
    if (before == NOBODY) return;
    const double past = visit(before).cost, most = visit(id).cost - past;
    const double cost = leg(at(before), at(id), most);
    if (cost <= most) visit(id).cost = past + cost, visit(id).from = before;
  }

  void expand(std::size_t id) {
    Cell& cell = cells_[id];
    const double past = visit(id).cost, to_goal = visit(id).to_goal, mine = weight(cell);
    if (to_goal < INFINITE) reach(GOAL, id, to_goal);
    neighbours(id, [&](std::size_t other) {
      Cell& o = cells_[other];
      if (!o.is_free || visit(other).is_done) return;
      const double length = norm(o.middle - cell.middle);
      if (!(past + length < visit(other).cost)) return;
      const bool is_sure = cell.clearance + o.clearance - length >= 2.0 * rules_.least;
      if (!is_sure && !(leg(cell.middle, o.middle) < INFINITE)) return;
      reach(other, id, length * (mine + weight(o)) / 2.0);
    });
  }

  // The free cells that a start or a goal is joined with, and at what cost: those next to it; or,
  // where it is too near to a wall, the nearest in sight, no farther away than `escape`. Out of what
  // is forbidden the nearest is taken, whatever lies between.
  std::vector<std::pair<std::size_t, double>> links(const Place& p) {
    std::vector<std::pair<std::size_t, double>> found;
    const double clear = clearance(p);
    const bool is_clear = clear >= rules_.least, is_out = clear > 0.0;
    std::vector<std::size_t> ring{leaf(p)};
    std::vector<std::size_t> seen = ring;
    double nearest = INFINITE;
    while (!ring.empty() && seen.size() < 200000) {
      std::vector<std::size_t> next;
      for (const std::size_t id : ring) {
        const Cell& cell = cells_[id];
        const double away = norm(cell.middle - p);
        if (away - cell.side * ROOT2 / 2.0 > std::min(rules_.escape, 2.0 * nearest)) continue;
        if (cell.is_free && away <= std::max(rules_.escape, cell.side * ROOT2)) {
          const double cost = is_clear ? leg(p, cell.middle) : escape(p, cell.middle, is_out);
          if (cost < INFINITE) found.emplace_back(id, cost), nearest = std::min(nearest, away);
        }
        neighbours(id, [&](std::size_t other) { next.push_back(other); });
      }
      std::sort(next.begin(), next.end());
      next.erase(std::unique(next.begin(), next.end()), next.end());
      ring.clear();
      std::set_difference(next.begin(), next.end(), seen.begin(), seen.end(), std::back_inserter(ring));
      const auto middle = static_cast<std::ptrdiff_t>(seen.size());
      seen.insert(seen.end(), ring.begin(), ring.end());
      std::inplace_merge(seen.begin(), seen.begin() + middle, seen.end());
    }
    if (!is_out) {  // not across what is forbidden
      const double far = 1.2 * nearest;
      std::erase_if(found, [&](const auto& link) { return norm(cells_[link.first].middle - p) > far; });
    }
    return found;
  }

  // [m] What it costs to come from too near a wall, or from where it is forbidden, to a free cell.
  double escape(const Place& p, const Place& to, bool is_out) {
    const double length = norm(to - p);
    if (length > rules_.escape || (is_out && !(clearance(p, to) > 0.0))) return INFINITE;
    return 2.0 * (1.0 + rules_.nearness) * length;
  }

  // Leaves out what is not needed, and moves corners to where the way is cheapest.
  void tauten(std::vector<Place>& places) {
    for (int round = 0; round < 2; ++round) {
      shorten(places);
      double step = rules_.wanted;
      for (int halving = 0; halving < 6; ++halving, step *= 0.5) {
        for (std::size_t i = 1; i + 1 < places.size(); ++i) shift(places, i, step);
      }
    }
    shorten(places);
  }

  void shorten(std::vector<Place>& places) {
    for (std::size_t i = 0; i + 2 < places.size(); ++i) {
      std::vector<double> cost(places.size(), 0.0);
      for (std::size_t j = i + 1; j < places.size(); ++j) {
        cost[j] = cost[j - 1] + leg(places[j - 1], places[j]);
      }
      for (std::size_t j = places.size() - 1; j > i + 1; --j) {
        if (!(leg(places[i], places[j], cost[j] * (1.0 + 1e-9)) < INFINITE)) continue;
        places.erase(places.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                     places.begin() + static_cast<std::ptrdiff_t>(j));
        break;
      }
    }
  }

  void shift(std::vector<Place>& places, std::size_t i, double step) {
    double best = leg(places[i - 1], places[i]) + leg(places[i], places[i + 1]);
    if (!(best < INFINITE)) return;
    const Place here = places[i];
    for (int k = 0; k < 8; ++k) {
      constexpr double D = ROOT2 / 2.0;
      constexpr std::array<std::array<double, 2>, 8> WAYS{
          {{1, 0}, {D, D}, {0, 1}, {-D, D}, {-1, 0}, {-D, -D}, {0, -1}, {D, -D}}};
      const auto [x, y] = WAYS[static_cast<std::size_t>(k)];
      const Place there = here + Place{step * x, step * y};
      const double first = leg(places[i - 1], there, best);
      if (!(first < best)) continue;
      const double both = first + leg(there, places[i + 1], best - first);
      if (both < best) best = both, places[i] = there;
    }
  }

  RouteRules rules_;
  std::vector<Segment> segments_;
  std::vector<Cell> cells_;  // the top cells first, by rows
  std::vector<std::int32_t> candidates_;
  std::deque<std::vector<std::int32_t>> lists_;
  std::vector<double> distances_;
  std::vector<std::vector<std::int32_t>> rays_;
  std::vector<Visit> visits_;
  std::vector<Entry> heap_;
  Visit at_start_, at_goal_;
  Place low_, start_, goal_, drift_;
  double root_side_ = 0.0, top_side_ = 0.0, ray_low_ = INFINITE, ray_width_ = 1.0;
  std::size_t top_count_ = 0;
  std::uint32_t search_ = 0;
  bool is_bounded_ = true, is_too_fine_ = false;
};

}  // namespace twinscrew
