// Boxes, cylinders and level plates, and where a ray enters them.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "beams.hpp"

namespace twinscrew {

using Vec3 = std::array<double, 3>;
using Mat3 = std::array<double, 9>;  // row-major

inline constexpr double kMiss = std::numeric_limits<double>::infinity();

inline double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vec3 row(const Mat3& m, int i) { return {m[3 * i], m[3 * i + 1], m[3 * i + 2]}; }
inline Vec3 column(const Mat3& m, int j) { return {m[j], m[3 + j], m[6 + j]}; }

/// A pose: axes R_AB and origin p_AB of B in A.
struct Pose {
  Mat3 R;
  Vec3 p;
};

Vec3 apply(const Pose& X_AB, const Vec3& p_B);
Pose compose(const Pose& X_AB, const Pose& X_BC);
Pose inverse(const Pose& X_AB);

enum class Kind : std::uint8_t { kBox = 0, kCylinder = 1, kPlate = 2 };

using Ring = std::vector<std::array<double, 2>>;

/// A solid centred in its own frame. Cylinder: along its x, half = (half length, radius, radius).
/// Plate: a polygon in its x-y plane, which only rays from above (negative z) meet; half bounds it.
struct Solid {
  Kind kind;
  Vec3 half;
  Pose X_OP;    // its own frame P in its object's frame O
  Ring ring{};  // a plate's corners
};

/// How far a solid reaches from its centre along a unit vector, given in its own frame.
double support(const Solid& solid, const Vec3& direction_P);

/// Angles that contain a solid at pose X_SP, with a lower bound of its distance.
struct View {
  Window window;
  double nearest;
};
View view(const Solid& solid, const Pose& X_SP);

/// Distance at which a ray enters a box; a ray that starts inside misses. Only the faces turned to
/// the origin can be entered, so a division by zero gives infinities or NaN, which miss as well.
inline double enter_box(const Vec3& half, const Vec3& o, const Vec3& d) {
  for (int i = 0; i < 3; ++i) {
    if (std::abs(o[i]) <= half[i]) continue;
    const int j = i == 2 ? 0 : i + 1, k = i == 0 ? 2 : i - 1;
    const double t = (std::copysign(half[i], o[i]) - o[i]) / d[i];
    if (t > 0 && std::abs(o[j] + t * d[j]) <= half[j] && std::abs(o[k] + t * d[k]) <= half[k]) {
      return t;
    }
  }
  return kMiss;
}

/// Distance at which a ray enters a cylinder along x: by the cap turned to the origin, or its side.
inline double enter_cylinder(const Vec3& half, const Vec3& o, const Vec3& d) {
  const double c = o[1] * o[1] + o[2] * o[2] - half[1] * half[1];
  if (std::abs(o[0]) > half[0]) {
    const double t = (std::copysign(half[0], o[0]) - o[0]) / d[0];
    const double y = o[1] + t * d[1], z = o[2] + t * d[2];
    if (t > 0 && y * y + z * z <= half[1] * half[1]) return t;
  }
  if (c <= 0) return kMiss;
  const double a = d[1] * d[1] + d[2] * d[2], b = o[1] * d[1] + o[2] * d[2];
  const double discriminant = b * b - a * c;
  if (discriminant < 0 || b >= 0) return kMiss;
  const double t = c / (std::sqrt(discriminant) - b);  // the nearer root, without cancellation
  return std::abs(o[0] + t * d[0]) <= half[0] ? t : kMiss;
}

/// Distance at which a ray from above meets a plate (even-odd rule).
inline double enter_plate(const Ring& ring, const Vec3& o, const Vec3& d) {
  if (o[2] >= 0 || d[2] <= 0) return kMiss;
  const double t = -o[2] / d[2], x = o[0] + t * d[0], y = o[1] + t * d[1];
  bool within = false;
  for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++) {
    const auto& a = ring[i];
    const auto& b = ring[j];
    if ((a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1])) {
      within = !within;
    }
  }
  return within ? t : kMiss;
}

inline double enter(const Solid& solid, const Vec3& o, const Vec3& d) {
  switch (solid.kind) {
    case Kind::kBox:
      return enter_box(solid.half, o, d);
    case Kind::kCylinder:
      return enter_cylinder(solid.half, o, d);
    case Kind::kPlate:
      return enter_plate(solid.ring, o, d);
  }
  return kMiss;
}

}  // namespace twinscrew
