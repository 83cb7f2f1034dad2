// From points to the range image: gates, angles, the vessel's attitude and motion, masks.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "lanes.hpp"
#include "plane.hpp"
#include "range_image.hpp"
#include "scanner.hpp"

namespace twinscrew {

using Matrix = std::array<float, 9>;  // row-major
using Vector = std::array<float, 3>;

// p' = R p + t
struct Transform {
  Matrix R;
  Vector t;
  // One coordinate of a point, or of four points at once.
  template <class Number>
  Number along(std::size_t axis, const Number& x, const Number& y, const Number& z) const {
    return R[3 * axis] * x + R[3 * axis + 1] * y + R[3 * axis + 2] * z + t[axis];
  }
};

// First X, then the rotation R.
inline Transform product(const Matrix& R, const Transform& X) {
  Transform result{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      result.t[i] += R[3 * i + k] * X.t[k];
      for (std::size_t j = 0; j < 3; ++j) result.R[3 * i + j] += R[3 * i + k] * X.R[3 * k + j];
    }
  }
  return result;
}

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

// A point of the vessel's frame, seen `seconds` after the stamp, as seen from the vessel at the stamp.
inline Vector moved(const Vector& p_B, float seconds, const Motion& motion) {
  Vector theta{}, p{};
  for (std::size_t i = 0; i < 3; ++i) theta[i] = motion.rates[i] * seconds;
  p = turned(p_B, theta);
  for (std::size_t i = 0; i < 3; ++i) p[i] += motion.velocity[i] * seconds;
  return p;
}

// Fills range images from clouds. Points are taken in blocks that stay in the first-level cache:
// gate and gather, then angles four at a time, then put into the image.
class Projection {
 public:
  Projection(const Scanner& scanner, const Gates& gates, const Plane& plane)
      : scanner_(scanner), gates_(gates), plane_(plane) {}

  // X_BS places the sensor on the vessel, R_LB levels B; motion may be null.
  Counts operator()(const Cloud& cloud, const Transform& X_BS, const Matrix& R_LB,
                    const Motion* motion, RangeImage& image) {
    const Transform X_LS = product(R_LB, X_BS);
    image.clear();
    counts_ = {};
    const std::size_t size = cloud.points_S.size() / 3;
    counts_.points = static_cast<std::int64_t>(size);
    for (std::size_t begin = 0; begin < size; begin += BLOCK) {
      const std::size_t end = std::min(begin + BLOCK, size);
      const std::size_t gathered = gather(cloud.points_S, begin, end);
      find(gathered, X_BS, X_LS);
      if (motion != nullptr) deskew(gathered, cloud, X_BS, R_LB, *motion);
      find_squares(gathered);
      put(gathered, cloud, image);
    }
    return counts_;
  }

 private:
  static constexpr std::size_t BLOCK = 512;
  using Lane = std::array<float, BLOCK>;

  // Keeps the points within range; NaN fails every comparison, infinity the upper one. Four at a
  // time; those that are left over are filled up with points at the origin, which are none.
  std::size_t gather(std::span<const float> points_S, std::size_t begin, std::size_t end) {
    std::size_t n = 0, present = 0, i = begin;
    for (; i + LANES <= end; i += LANES) n = keep(Float4x3(&points_S[3 * i]), i, n, present);
    if (i < end) {
      std::array<float, 3 * LANES> rest{};
      std::copy(points_S.begin() + static_cast<std::ptrdiff_t>(3 * i),
                points_S.begin() + static_cast<std::ptrdiff_t>(3 * end), rest.begin());
      n = keep(Float4x3(rest.data()), i, n, present);
    }
    counts_.empty += static_cast<std::int64_t>(end - begin - present);
    counts_.range += static_cast<std::int64_t>(present - n);
    return n;
  }

  // Stores what is kept of four points, the first of which is `i`, from `n` on; gives the new n.
  std::size_t keep(const Float4x3& p, std::size_t i, std::size_t n, std::size_t& present) {
    constexpr float finite = std::numeric_limits<float>::max();
    const float least = gates_.range_min * gates_.range_min;
    const float greatest = gates_.range_max * gates_.range_max;
    const Float4 square = p.x * p.x + p.y * p.y + p.z * p.z;
    const Int4 some = square > 0.0F;
    const unsigned kept = bits(some & (square >= least) & (square <= greatest));
    present += static_cast<std::size_t>(std::popcount(bits(some & (square <= finite))));
    const auto first = static_cast<std::int32_t>(i);
    if (kept == 15U) {
      store(&x_[n], p.x);
      store(&y_[n], p.y);
      store(&z_[n], p.z);
      store(&range_[n], square);
      store(&point_[n], Int4{0, 1, 2, 3} + first);
      return n + LANES;
    }
    for (unsigned left = kept; left != 0; left &= left - 1, ++n) {
      const int lane = std::countr_zero(left);
      x_[n] = p.x[lane];
      y_[n] = p.y[lane];
      z_[n] = p.z[lane];
      range_[n] = square[lane];
      point_[n] = first + lane;
    }
    return n;
  }

  // Range, direction and place of the gathered points, four at a time. The arguments and `bins`
  // are copies, which no store into a lane can change.
  void find(std::size_t n, const Transform X_BS, const Transform X_LS) {
    const Bins bins = scanner_.bins();
    const Float4 hull_middle = all(0.5F * (gates_.hull_fore + gates_.hull_aft));
    const Float4 hull_length = all(0.5F * (gates_.hull_fore - gates_.hull_aft));
    const Float4 hull_width = all(gates_.mask_hull ? gates_.hull_half_width : -1.0F);
    for (std::size_t i = 0; i < n; i += LANES) {
      const Float4 x = load(&x_[i]), y = load(&y_[i]), z = load(&z_[i]);
      store(&range_[i], square_root(load(&range_[i])));
      const Float4 tangent = -z / square_root(x * x + y * y);
      const Int4 bin = bins.elevation(tangent), column = bins.column(x, y);
      // The hull moves with the sensor: its mask needs no levelling and no deskewing.
      const Int4 hull = (absolute(X_BS.along(0, x, y, z) - hull_middle) <= hull_length) &
                        (absolute(X_BS.along(1, x, y, z)) <= hull_width);
      store(&tangent_[i], tangent);
      store(&bin_[i], bin);
      store(&column_[i], column);
      store(&out_[i], ((bin | column) < 0) | (hull & 2));  // -1: no beam, 2: hull, 0: neither
      for (std::size_t axis = 0; axis < 3; ++axis) {
        store(&p_L_[axis][i], X_LS.along(axis, x, y, z));
      }
    }
  }

  void find_squares(std::size_t n) {
    const Plane plane = plane_;
    for (std::size_t i = 0; i < n; i += LANES) {
      store(&square_[i], plane.square(load(&p_L_[0][i]), load(&p_L_[1][i])));
    }
  }

  // What becomes of the gathered points. The counts are copies, which stay in registers.
  void put(std::size_t n, const Cloud& cloud, RangeImage& image) {
    std::int64_t no_beam = 0, hull = 0, water = 0, used = 0, hidden = 0;
    RangeImage::Pen pen(image);
    for (std::size_t i = 0; i < n; ++i) {
      if (out_[i] != 0) {
        ++(out_[i] < 0 ? no_beam : hull);
      } else if (gates_.drop_water && is_water(i, cloud)) {
        ++water;
      } else {
        const int row = scanner_.row(bin_[i], tangent_[i]);
        const Echo echo{p_L_[0][i], p_L_[1][i], square_[i], point_[i]};
        ++(pen.put(row, column_[i], range_[i], echo) ? used : hidden);
      }
    }
    counts_.no_beam += no_beam;
    counts_.hull += hull;
    counts_.water += water;
    counts_.used += used;
    counts_.hidden += hidden;
  }

  bool is_water(std::size_t i, const Cloud& cloud) const {
    const float height = gates_.surface_down - p_L_[2][i];
    if (height < gates_.clearance) return true;
    return height < gates_.weak_clearance && !cloud.intensity.empty() &&
           cloud.intensity[static_cast<std::size_t>(point_[i])] <= gates_.weak;
  }

  // Puts the gathered points where they were, seen from the vessel at the stamp.
  void deskew(std::size_t n, const Cloud& cloud, const Transform& X_BS, const Matrix& R_LB,
              const Motion& motion) {
    const Transform X_LB{R_LB, {}};
    for (std::size_t i = 0; i < n; ++i) {
      Vector p{};
      for (std::size_t axis = 0; axis < 3; ++axis) p[axis] = X_BS.along(axis, x_[i], y_[i], z_[i]);
      p = moved(p, time(i, cloud, motion), motion);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        p_L_[axis][i] = X_LB.along(axis, p[0], p[1], p[2]);
      }
    }
  }

  float time(std::size_t i, const Cloud& cloud, const Motion& motion) const {
    if (cloud.time.empty()) {
      return motion.first_time + motion.time_per_column * static_cast<float>(column_[i]);
    }
    const float told = cloud.time[static_cast<std::size_t>(point_[i])];
    return std::fabs(told) < 10.0F ? told : 0.0F;  // a scan lasts less; NaN fails the test
  }

  const Scanner& scanner_;
  Gates gates_;
  Plane plane_;
  Counts counts_;
  Lane x_{}, y_{}, z_{}, range_{}, tangent_{};
  std::array<Lane, 3> p_L_{};  // [m] the vessel's frame, levelled
  std::array<std::int32_t, BLOCK> point_{}, bin_{}, column_{}, out_{}, square_{};
};

}  // namespace twinscrew
