// From points to the range image: gates, angles, the vessel's attitude and motion, masks.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "range_image.hpp"
#include "scanner.hpp"

namespace twinscrew {

using Matrix = std::array<float, 9>;  // row-major
using Vector = std::array<float, 3>;

// p' = R p + t
struct Transform {
  Matrix R;
  Vector t;
  Vector operator()(float x, float y, float z) const {
    return {R[0] * x + R[1] * y + R[2] * z + t[0], R[3] * x + R[4] * y + R[5] * z + t[1],
            R[6] * x + R[7] * y + R[8] * z + t[2]};
  }
};

// Which echoes are of use. Lengths in metres, in the vessel's frame B (forward, starboard, down).
struct Gates {
  float range_min = 0.0F, range_max = 20.0F;
  bool mask_hull = false;
  float hull_aft = 0.0F, hull_fore = 0.0F, hull_half_width = 0.0F;
  bool drop_water = false;
  float surface_down = 0.0F;   // the water surface, down from the vessel's origin
  float clearance = 0.0F;      // echoes lower than this over the surface are water
  float weak_clearance = 0.0F;  // and so are weak echoes lower than this
  float weak = -std::numeric_limits<float>::infinity();  // [sensor's own] at most this is weak
};

// How the vessel moved while the scan was taken; angles and lengths a second, frame B.
struct Motion {
  Vector rates{}, velocity{};
  float first_time = 0.0F, time_per_column = 0.0F;  // [s] from columns, where points tell no time
};

struct Cloud {
  std::span<const float> points_S;    // (N, 3)
  std::span<const float> intensity;   // (N,) or empty
  std::span<const float> time;        // (N,) or empty [s]
};

// What became of the points; the counts add up to all of them.
struct Counts {
  std::int64_t points = 0, empty = 0, range = 0, no_beam = 0, hull = 0, water = 0, hidden = 0,
               used = 0;
};

// Turns a vector by the small rotation theta, to second order: an error of |theta|^3 / 6.
inline Vector turned(const Vector& p, const Vector& theta) {
  const auto cross = [](const Vector& a, const Vector& b) {
    return Vector{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                  a[0] * b[1] - a[1] * b[0]};
  };
  const Vector once = cross(theta, p), twice = cross(theta, once);
  return {p[0] + once[0] + 0.5F * twice[0], p[1] + once[1] + 0.5F * twice[1],
          p[2] + once[2] + 0.5F * twice[2]};
}

// Fills range images from clouds. Points are taken in blocks that stay in the first-level cache:
// gate and gather, then angles (a loop without branches), then put into the image.
class Projection {
 public:
  Projection(const Scanner& scanner, const Gates& gates) : scanner_(scanner), gates_(gates) {}

  // X_BS places the sensor on the vessel, X_LB levels B; motion may be null.
  Counts operator()(const Cloud& cloud, const Transform& X_BS, const Matrix& R_LB,
                    const Motion* motion, RangeImage& image) {
    image.clear();
    counts_ = {};
    const std::size_t size = cloud.points_S.size() / 3;
    counts_.points = static_cast<std::int64_t>(size);
    for (std::size_t begin = 0; begin < size; begin += BLOCK) {
      const std::size_t end = std::min(begin + BLOCK, size);
      const std::size_t gathered = gather(cloud.points_S, begin, end);
      find_angles(gathered);
      for (std::size_t i = 0; i < gathered; ++i) put(i, cloud, X_BS, R_LB, motion, image);
    }
    return counts_;
  }

 private:
  static constexpr std::size_t BLOCK = 512;
  using Lane = std::array<float, BLOCK>;

  // Keeps the points within range; NaN fails every comparison, infinity the upper one.
  std::size_t gather(std::span<const float> points_S, std::size_t begin, std::size_t end) {
    const float least = gates_.range_min * gates_.range_min;
    const float greatest = gates_.range_max * gates_.range_max;
    constexpr float finite = std::numeric_limits<float>::max();
    std::size_t n = 0, present = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const float x = points_S[3 * i], y = points_S[3 * i + 1], z = points_S[3 * i + 2];
      const float square = x * x + y * y + z * z;
      x_[n] = x;
      y_[n] = y;
      z_[n] = z;
      range_[n] = square;
      point_[n] = static_cast<std::int32_t>(i);
      present += static_cast<std::size_t>(square > 0.0F && square <= finite);
      n += static_cast<std::size_t>(square > 0.0F && square >= least && square <= greatest);
    }
    counts_.empty += static_cast<std::int64_t>(end - begin - present);
    counts_.range += static_cast<std::int64_t>(present - n);
    return n;
  }

  void find_angles(std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) {
      range_[i] = std::sqrt(range_[i]);
      tangent_[i] = -z_[i] / std::sqrt(x_[i] * x_[i] + y_[i] * y_[i]);
      column_[i] = scanner_.column_of(x_[i], y_[i]);
    }
  }

  void put(std::size_t i, const Cloud& cloud, const Transform& X_BS, const Matrix& R_LB,
           const Motion* motion, RangeImage& image) {
    const int row = scanner_.row(tangent_[i]);
    const int column = scanner_.column(column_[i]);
    if (row < 0 || column < 0) {
      ++counts_.no_beam;
      return;
    }
    const auto point = static_cast<std::size_t>(point_[i]);
    Vector p_B = X_BS(x_[i], y_[i], z_[i]);
    if (gates_.mask_hull && on_hull(p_B)) {  // the hull moves with the sensor: before deskewing
      ++counts_.hull;
      return;
    }
    if (motion != nullptr) p_B = deskewed(p_B, time(cloud, point, column, *motion), *motion);
    const Vector p_L = Transform{R_LB, {}}(p_B[0], p_B[1], p_B[2]);
    if (gates_.drop_water && is_water(p_L[2], cloud, point)) {
      ++counts_.water;
      return;
    }
    const bool fresh = image.put(row, column, range_[i], {p_L[0], p_L[1], point_[i]});
    ++(fresh ? counts_.used : counts_.hidden);
  }

  bool on_hull(const Vector& p_B) const {
    return p_B[0] >= gates_.hull_aft && p_B[0] <= gates_.hull_fore &&
           std::fabs(p_B[1]) <= gates_.hull_half_width;
  }

  bool is_water(float down, const Cloud& cloud, std::size_t point) const {
    const float height = gates_.surface_down - down;
    if (height < gates_.clearance) return true;
    return height < gates_.weak_clearance && !cloud.intensity.empty() &&
           cloud.intensity[point] <= gates_.weak;
  }

  static float time(const Cloud& cloud, std::size_t point, int column, const Motion& motion) {
    if (cloud.time.empty()) {
      return motion.first_time + motion.time_per_column * static_cast<float>(column);
    }
    const float told = cloud.time[point];
    return std::fabs(told) < 10.0F ? told : 0.0F;  // a scan lasts less; NaN fails the test
  }

  // Where a point seen at `seconds` after the stamp was, seen from the vessel at the stamp.
  static Vector deskewed(const Vector& p_B, float seconds, const Motion& motion) {
    const Vector& w = motion.rates;
    const Vector p = turned(p_B, {w[0] * seconds, w[1] * seconds, w[2] * seconds});
    const Vector& v = motion.velocity;
    return {p[0] + v[0] * seconds, p[1] + v[1] * seconds, p[2] + v[2] * seconds};
  }

  const Scanner& scanner_;
  Gates gates_;
  Counts counts_;
  Lane x_, y_, z_, range_, tangent_, column_;
  std::array<std::int32_t, BLOCK> point_;
};

}  // namespace twinscrew
