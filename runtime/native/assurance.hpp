// Where a manoeuvre takes the vessel, and whether that leads to contact. Derivation:
// docs/assurance.md; tests/reference/assurance.py is the same in plain Python.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "segment.hpp"

namespace twinscrew {

using Thrusts = std::array<double, 2>;  // [N] of the left and the right propeller
using Planar = std::array<double, 3>;   // surge, sway [m/s], yaw rate [rad/s]; or x, y [m], heading
using Push = std::array<double, 2>;     // [N] x and y, in the frame of the beginning: as from wind

// What a manoeuvre wants of the propellers: `first` for a while, then base - gain * surge.
struct Law {
  Thrusts base{};
  double gain = 0.0;  // [N s/m]
  double low = -std::numeric_limits<double>::infinity();   // [N]
  double high = std::numeric_limits<double>::infinity();   // [N]
  Thrusts first{};
  double until = 0.0;  // [s]

  Thrusts operator()(double time, double surge) const {
    if (time < until - 1e-9) return first;
    const double against = -gain * surge;
    return {std::min(std::max(against + base[0], low), high),
            std::min(std::max(against + base[1], low), high)};
  }
};

struct VesselInPlane {
  Planar inertia, linear, quadratic;  // of surge, sway, yaw; drag is positive
  double lever;                       // [m] from the centre line to a propeller
};

struct HullCircle {
  double ahead, radius;  // [m]
};

struct ContactRules {
  int steps;        // [-] of a prediction
  double dt;        // [s] their length
  double slew;      // [N/s] how fast each thrust may change
  double margin;    // [m] nearer than this, closing in is limited
  double approach;  // [1/s] to this times the gap
};

// What is around, going straight on: a row each.
struct Surroundings {
  std::span<const double> p, v;             // [m], [m/s] x and y
  std::span<const double> radius, horizon;  // [m], [s]
  std::size_t size() const { return radius.size(); }
};

// The boundary of what is forbidden, which lies to the left of each piece.
struct Shores {
  std::span<const Segment> pieces;
  double clearance = 0.0;  // [m] they count as this much nearer
  double margin = 0.0;     // [m] nearer than this, closing in is limited
  double horizon = 0.0;    // [s] how far ahead they matter
};

struct Contact {
  static constexpr int NONE = -1, SHORE = -2;
  double excess = 0.0;  // [m/s] how much faster than allowed it closes in, and how long
  double time = std::numeric_limits<double>::infinity();  // [s] until it first does
  double speed = 0.0;                                     // [m/s] how fast it then closes in
  int circle = -1;                                        // which one it is; SHORE: a shore
  bool to_starboard = false;
};

// Predicts and judges; keeps its memory between calls.
class Foresight {
  // [1/s] What comes too fast for a second counts as much as what comes twice as fast.
  // Without it all ways out are alike where the first moment, which none can change, is the worst.
  static constexpr double LASTING = 1.0;
  // [m] However deep surfaces overlap, the vessel need not leave faster than from here: a boat that
  // lies alongside within our circle is no reason to flee.
  static constexpr double DEEPEST = 0.2;

 public:
  // `close`: circles that cover the hull closely, for shores; between two quays there is no room for
  // a circle about all of it.
  Foresight(const VesselInPlane& vessel, std::vector<HullCircle> hull, const ContactRules& rules,
            std::vector<HullCircle> close = {})
      : vessel_(vessel),
        hull_(std::move(hull)),
        close_(close.empty() ? hull_ : std::move(close)),
        rules_(rules),
        path_(static_cast<std::size_t>(rules.steps) + 1) {}

  // How the velocity changes, pushed in the vessel's own frame [m/s2, m/s2, rad/s2].
  // Fossen (2021), chapters 3 and 6; added mass is within the inertia.
  Planar acceleration(const Planar& nu, const Thrusts& thrust, const Push& push = {}) const {
    const auto [u, v, r] = nu;
    const auto [m11, m22, m66] = vessel_.inertia;
    const auto drag = [&](std::size_t i) {
      return (vessel_.linear[i] + vessel_.quadratic[i] * std::fabs(nu[i])) * nu[i];
    };
    const double surge = thrust[0] + thrust[1] + m22 * v * r - drag(0) + push[0];
    const double sway = -m11 * u * r - drag(1) + push[1];
    const double yaw = (thrust[0] - thrust[1]) * vessel_.lever + (m11 - m22) * u * v - drag(2);
    return {surge / m11, sway / m22, yaw / m66};
  }

  // Euler steps of the velocity, trapezoids of the position, from the origin on.
  std::span<const Planar> sail(const Planar& motion, Thrusts thrust, const Law& law,
                               const Push& push = {}) {
    auto [u, v, r] = motion;
    Planar pose{};
    path_[0] = pose;
    for (int step = 0; step < rules_.steps; ++step) {
      thrust = slewed(thrust, law(step * rules_.dt, u));
      const auto [ax, ay, ar] = acceleration({u, v, r}, thrust, turned(push, pose[2]));
      const double du = rules_.dt * ax, dv = rules_.dt * ay, dr = rules_.dt * ar;
      // The mean of the velocities before and after: the new ones alone would brake too well.
      const double ahead = u + du / 2.0, across = v + dv / 2.0;
      const double turn = rules_.dt * (r + dr / 2.0);
      const double cosine = std::cos(pose[2] + turn / 2.0), sine = std::sin(pose[2] + turn / 2.0);
      pose[0] += rules_.dt * (cosine * ahead - sine * across);
      pose[1] += rules_.dt * (sine * ahead + cosine * across);
      pose[2] += turn;
      u += du, v += dv, r += dr;
      path_[static_cast<std::size_t>(step) + 1] = pose;
    }
    return path_;
  }

  // The worst that a path leads to, and the first time that it closes in too fast. What comes later
  // counts less, down to nothing at the horizon: until then there is time to decide again.
  Contact judge(std::span<const Planar> path, const Surroundings& around,
                const Shores& shores = {}) {
    Contact worst;
    fields_.assign(close_.size(), {});
    double peak = 0.0, sum = 0.0;
    for (std::size_t step = 1; step < path.size(); ++step) {
      Contact now;
      for (const HullCircle& own : hull_) {
        for (std::size_t k = 0; k < around.size(); ++k) meet(path, step, own, around, k, now);
      }
      if (!shores.pieces.empty()) meet_shores(path, step, shores, now);
      if (now.circle == Contact::SHORE && worst.circle == Contact::NONE) worst = now;
      if (now.circle >= 0 && worst.circle == Contact::NONE) {
        worst = now;
        worst.speed = fastest(path, step, around, static_cast<std::size_t>(now.circle));
        worst.to_starboard = starboard(path, step, around, static_cast<std::size_t>(now.circle));
      }
      peak = std::max(peak, now.excess);
      sum += now.excess;
    }
    worst.excess = peak + LASTING * rules_.dt * sum;
    return worst;
  }

 private:
  Thrusts slewed(Thrusts thrust, const Thrusts& wanted) const {
    const double most = rules_.slew * rules_.dt;
    for (std::size_t i = 0; i < 2; ++i) {
      thrust[i] += std::min(std::max(wanted[i] - thrust[i], -most), most);
    }
    return thrust;
  }

  static Push turned(const Push& push, double heading) {
    const double cosine = std::cos(heading), sine = std::sin(heading);
    return {cosine * push[0] + sine * push[1], cosine * push[1] - sine * push[0]};
  }

  // From a circle of the hull to where a track then is.
  Thrusts apart(const Planar& pose, double ahead, const Surroundings& around, std::size_t k,
                std::size_t step) const {
    const double time = static_cast<double>(step) * rules_.dt;
    double x = around.p[2 * k] + time * around.v[2 * k] - pose[0];
    double y = around.p[2 * k + 1] + time * around.v[2 * k + 1] - pose[1];
    if (ahead != 0.0) x -= ahead * std::cos(pose[2]), y -= ahead * std::sin(pose[2]);
    return {x, y};
  }

  double gap(std::span<const Planar> path, std::size_t step, const HullCircle& own,
             const Surroundings& around, std::size_t k) const {
    const auto [x, y] = apart(path[step], own.ahead, around, k, step);
    return std::sqrt(x * x + y * y) - (own.radius + around.radius[k]);
  }

  // [m/s] How fast they closed in during the step that ends here.
  double closing(std::span<const Planar> path, std::size_t step, const HullCircle& own,
                 const Surroundings& around, std::size_t k) const {
    return (gap(path, step - 1, own, around, k) - gap(path, step, own, around, k)) / rules_.dt;
  }

  // Keeps the greatest excess of this step.
  void meet(std::span<const Planar> path, std::size_t step, const HullCircle& own,
            const Surroundings& around, std::size_t k, Contact& now) const {
    const double left = gap(path, step, own, around, k);
    if (!(left < rules_.margin)) return;
    const double time = static_cast<double>(step) * rules_.dt;
    const double weight = 1.0 - time / (around.horizon[k] + rules_.dt);
    const double allowed = rules_.approach * std::max(left, -DEEPEST);
    const double excess =
        (closing(path, step, own, around, k) - allowed) * std::max(weight, 0.0);
    if (excess > now.excess) now = {.excess = excess, .time = time, .circle = static_cast<int>(k)};
  }

  // What is known of how far a hull's circle is from the shores, from a place where it was looked at.
  struct Field {
    Place at{};
    double distance = -std::numeric_limits<double>::infinity();
  };

  // [m] To the nearest shore, negative where it is forbidden. At a corner two pieces are as near;
  // the one that is seen more from its side tells on which one this is.
  static std::pair<double, Place> to_shore(const Place& p, std::span<const Segment> pieces) {
    double least = std::numeric_limits<double>::infinity(), square = 0.0, side = 0.0;
    Place to{};
    for (const Segment& piece : pieces) {
      const Place off = piece.nearest(p) - p;
      const double d2 = dot(off, off);
      if (d2 > least * (1.0 + 1e-9) + 1e-12) continue;
      const Place along = piece.b - piece.a;
      const double length = norm(along);
      if (!(length > 0.0)) continue;
      const double off_line = cross(along, p - piece.a) / length;
      const bool is_nearer = d2 < least * (1.0 - 1e-9) - 1e-12;
      if (!is_nearer && std::fabs(off_line) <= std::fabs(side)) continue;
      least = is_nearer ? d2 : std::min(d2, least), square = d2, side = off_line, to = off;
    }
    return {side > 0.0 ? -std::sqrt(square) : std::sqrt(least), to};
  }

  static Place centre(const Planar& pose, double ahead) {
    return {pose[0] + ahead * std::cos(pose[2]), pose[1] + ahead * std::sin(pose[2])};
  }

  // The same as `meet`, with the nearest shore in a circle's place. Where the last look shows that
  // none can be near enough by now, it is not looked for.
  void meet_shores(std::span<const Planar> path, std::size_t step, const Shores& shores,
                   Contact& now) {
    const double time = static_cast<double>(step) * rules_.dt;
    const double weight = std::max(1.0 - time / (shores.horizon + rules_.dt), 0.0);
    for (std::size_t h = 0; h < close_.size(); ++h) {
      const double size = close_[h].radius + shores.clearance;
      const Place here = centre(path[step], close_[h].ahead);
      Field& known = fields_[h];
      if (known.distance - norm(here - known.at) - size >= shores.margin) continue;
      const auto [distance, to] = to_shore(here, shores.pieces);
      known = {here, distance};
      const double left = distance - size;
      if (!(left < shores.margin)) continue;
      const Place before = centre(path[step - 1], close_[h].ahead);
      const double closing = (to_shore(before, shores.pieces).first - distance) / rules_.dt;
      const double allowed = rules_.approach * std::max(left, -DEEPEST);
      const double excess = (closing - allowed) * weight;
      if (!(excess > now.excess)) continue;
      const double starboard = std::cos(path[step][2]) * to.y - std::sin(path[step][2]) * to.x;
      now = {excess, time, closing, Contact::SHORE, (distance < 0.0 ? -starboard : starboard) > 0.0};
    }
  }

  double fastest(std::span<const Planar> path, std::size_t step, const Surroundings& around,
                 std::size_t k) const {
    double most = -std::numeric_limits<double>::infinity();
    for (const HullCircle& own : hull_) most = std::max(most, closing(path, step, own, around, k));
    return most;
  }

  bool starboard(std::span<const Planar> path, std::size_t step, const Surroundings& around,
                 std::size_t k) const {
    const auto [x, y] = apart(path[step], 0.0, around, k, step);
    return std::cos(path[step][2]) * y > std::sin(path[step][2]) * x;
  }

  VesselInPlane vessel_;
  std::vector<HullCircle> hull_, close_;
  ContactRules rules_;
  std::vector<Planar> path_;
  std::vector<Field> fields_;  // of each circle of the close hull
};

}  // namespace twinscrew
