#include "solids.hpp"

#include <algorithm>
#include <numbers>

namespace twinscrew {

Vec3 apply(const Pose& X_AB, const Vec3& p_B) {
  Vec3 p_A;
  for (int i = 0; i < 3; ++i) p_A[i] = dot(row(X_AB.R, i), p_B) + X_AB.p[i];
  return p_A;
}

Pose compose(const Pose& X_AB, const Pose& X_BC) {
  Pose X_AC;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) X_AC.R[3 * i + j] = dot(row(X_AB.R, i), column(X_BC.R, j));
  }
  X_AC.p = apply(X_AB, X_BC.p);
  return X_AC;
}

Pose inverse(const Pose& X_AB) {
  Pose X_BA;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) X_BA.R[3 * i + j] = X_AB.R[3 * j + i];
    X_BA.p[i] = -dot(column(X_AB.R, i), X_AB.p);
  }
  return X_BA;
}

double support(const Solid& solid, const Vec3& u) {
  if (solid.kind != Kind::kCylinder) {
    return solid.half[0] * std::abs(u[0]) + solid.half[1] * std::abs(u[1]) +
           solid.half[2] * std::abs(u[2]);
  }
  return solid.half[0] * std::abs(u[0]) + solid.half[1] * std::sqrt(u[1] * u[1] + u[2] * u[2]);
}

View view(const Solid& solid, const Pose& X_SP) {
  // An upright box around the solid, turned towards it: u points at its centre, v is across.
  const double range = std::hypot(X_SP.p[0], X_SP.p[1]);
  const Vec3 u = range > 0 ? Vec3{X_SP.p[0] / range, X_SP.p[1] / range, 0} : Vec3{1, 0, 0};
  const auto reach = [&](const Vec3& direction_S) {
    const Mat3& R = X_SP.R;
    return support(solid, {dot(column(R, 0), direction_S), dot(column(R, 1), direction_S),
                           dot(column(R, 2), direction_S)});
  };
  const double along = reach(u), across = reach({-u[1], u[0], 0}), upright = reach({0, 0, 1});

  const double near = std::max(range - along, 0.0), far = std::hypot(range + along, across);
  const double top = -X_SP.p[2] + upright, bottom = -X_SP.p[2] - upright;  // up is positive
  View seen{};
  seen.window.elevation_high = std::atan2(top, top > 0 ? near : far);
  seen.window.elevation_low = std::atan2(bottom, bottom < 0 ? near : far);
  seen.window.azimuth = std::atan2(u[1], u[0]);
  seen.window.half_azimuth = near > 0 ? std::atan2(across, near) : std::numbers::pi;
  seen.nearest = std::hypot(near, std::max({-top, bottom, 0.0}));
  return seen;
}

}  // namespace twinscrew
