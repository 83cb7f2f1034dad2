// From points to the range image: gates, angles, the vessel's attitude and motion, masks.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numbers>
#include <span>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

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

// What the loops leave of some hundred points, which stay in the first-level cache.
struct Block {
  static constexpr std::size_t SIZE = 512;
  using Lane = std::array<float, SIZE>;
  using Numbers = std::array<std::int32_t, SIZE>;
  Lane x{}, y{}, z{}, range{}, tangent{};
  std::array<Lane, 3> p_L{};  // [m] levelled frame L
  Numbers point{}, bin{}, column{}, fate{};
  std::array<Echo, SIZE> echo{};
};

// A point's fate: bits of why it may not be used.
inline constexpr std::int32_t NO_BEAM = 1, HULL = 2, WATER = 4, MAY_BE_WATER = 8;

// The loops over a block, for some number of lanes.
struct Loops {
  std::size_t (*gather)(std::span<const float>, std::size_t, std::size_t, const Gates&, Block&,
                        std::size_t&);
  void (*find)(std::size_t, const Bins&, const Gates&, const Transform&, const Transform&, Block&);
  void (*deskew)(std::size_t, std::span<const float>, const Transform&, const Transform&,
                 const Motion&, Block&);
  void (*place)(std::size_t, const Gates&, const Plane&, Block&);
};

#define LANES 4
namespace four {
#include "projection_lanes.inc"
}  // namespace four
#undef LANES

// The wide loops are compiled for a processor that has them, whatever the rest is compiled for.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define TWINSCREW_WIDE 1
#pragma GCC push_options
#pragma GCC target("avx2")
#define LANES 8
namespace eight {
#include "projection_lanes.inc"
}  // namespace eight
#undef LANES
#pragma GCC pop_options
#endif

inline bool has_eight_lanes() {
#ifdef TWINSCREW_WIDE
  return __builtin_cpu_supports("avx2");
#else
  return false;
#endif
}

// The loops with 4 or, where the processor has them, 8 lanes.
inline const Loops& loops(bool wide) {
#ifdef TWINSCREW_WIDE
  if (wide) return eight::loops;
#endif
  (void)wide;
  return four::loops;
}

// Fills range images from clouds, block by block: gather what is of use, find directions and places
// many at a time, then put the echoes into the image.
class Projection {
 public:
  Projection(const Scanner& scanner, const Gates& gates, const Plane& plane, bool wide)
      : scanner_(scanner), gates_(gates), plane_(plane), loops_(loops(wide)) {}

  // X_BS places the sensor on the vessel, R_LB levels B; motion may be null.
  Counts operator()(const Cloud& cloud, const Transform& X_BS, const Matrix& R_LB,
                    const Motion* motion, RangeImage& image) {
    const Transform X_LS = product(R_LB, X_BS), X_LB{R_LB, {}};
    image.clear();
    Counts counts;
    const std::size_t size = cloud.points_S.size() / 3;
    counts.points = static_cast<std::int64_t>(size);
    for (std::size_t begin = 0; begin < size; begin += Block::SIZE) {
      const std::size_t end = std::min(begin + Block::SIZE, size);
      std::size_t present = 0;
      const std::size_t n = loops_.gather(cloud.points_S, begin, end, gates_, block_, present);
      counts.empty += static_cast<std::int64_t>(end - begin - present);
      counts.range += static_cast<std::int64_t>(present - n);
      loops_.find(n, scanner_.bins(), gates_, X_BS, X_LS, block_);
      if (motion != nullptr) loops_.deskew(n, cloud.time, X_BS, X_LB, *motion, block_);
      loops_.place(n, gates_, plane_, block_);
      put(n, cloud, image, counts);
    }
    return counts;
  }

 private:
  // The scanner's and the image's addresses are copies, which no store into the image can change.
  void put(std::size_t n, const Cloud& cloud, RangeImage& image, Counts& counts) const {
    const Rows rows = scanner_.to_rows();
    const std::size_t stride = image.cell(1, 0);
    std::int64_t left_out = 0, hidden = 0;
    RangeImage::Pen pen(image);
    for (std::size_t i = 0; i < n; ++i) {
      if (block_.fate[i] != 0 && is_left_out(i, cloud, counts)) {
        ++left_out;
        continue;
      }
      const std::size_t row = rows.of(block_.bin[i], block_.tangent[i]);
      const std::size_t cell = row * stride + static_cast<std::size_t>(block_.column[i]);
      hidden += !pen.put(cell, block_.range[i], block_.echo[i]);
    }
    counts.hidden += hidden;
    counts.used += static_cast<std::int64_t>(n) - left_out - hidden;
  }

  // Counts a point that is not used.
  bool is_left_out(std::size_t i, const Cloud& cloud, Counts& counts) const {
    const std::int32_t fate = block_.fate[i];
    if ((fate & NO_BEAM) != 0) return ++counts.no_beam, true;
    if ((fate & HULL) != 0) return ++counts.hull, true;
    const bool is_weak =
        !cloud.intensity.empty() &&
        cloud.intensity[static_cast<std::size_t>(block_.point[i])] <= gates_.weak;
    if ((fate & WATER) != 0 || is_weak) return ++counts.water, true;
    return false;
  }

  const Scanner& scanner_;
  Gates gates_;
  Plane plane_;
  const Loops& loops_;
  Block block_;
};

}  // namespace twinscrew
