// Places and straight pieces in the plane.
#pragma once

#include <algorithm>
#include <cmath>

namespace twinscrew {

struct Place {
  double x = 0.0, y = 0.0;  // [m]
  friend Place operator+(const Place& a, const Place& b) { return {a.x + b.x, a.y + b.y}; }
  friend Place operator-(const Place& a, const Place& b) { return {a.x - b.x, a.y - b.y}; }
  friend Place operator*(double k, const Place& a) { return {k * a.x, k * a.y}; }
};

inline double dot(const Place& a, const Place& b) { return a.x * b.x + a.y * b.y; }
inline double cross(const Place& a, const Place& b) { return a.x * b.y - a.y * b.x; }
inline double norm(const Place& a) { return std::sqrt(dot(a, a)); }

struct Segment {
  Place a, b;

  Place nearest(const Place& p) const {
    const Place along = b - a;
    const double length2 = dot(along, along);
    const double share = length2 > 0.0 ? std::clamp(dot(p - a, along) / length2, 0.0, 1.0) : 0.0;
    return a + share * along;
  }
  double distance2(const Place& p) const {
    const Place off = p - nearest(p);
    return dot(off, off);
  }
  bool meets(const Segment& o) const {
    const double c1 = cross(b - a, o.a - a), c2 = cross(b - a, o.b - a);
    const double c3 = cross(o.b - o.a, a - o.a), c4 = cross(o.b - o.a, b - o.a);
    return ((c1 > 0.0) != (c2 > 0.0)) && ((c3 > 0.0) != (c4 > 0.0));
  }
  double distance2(const Segment& o) const {
    if (meets(o)) return 0.0;
    return std::min(std::min(distance2(o.a), distance2(o.b)),
                    std::min(o.distance2(a), o.distance2(b)));
  }
};

}  // namespace twinscrew
