// Four floats or two doubles at once, with the compiler's own vectors; the same results on every
// machine.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace twinscrew {

inline constexpr std::size_t LANES = 4;
typedef float Float4 __attribute__((vector_size(4 * LANES)));
typedef std::int32_t Int4 __attribute__((vector_size(4 * LANES)));
typedef double Double2 __attribute__((vector_size(16)));
typedef std::int64_t Long2 __attribute__((vector_size(16)));

inline Float4 load(const float* from) {
  Float4 v;
  std::memcpy(&v, from, sizeof v);
  return v;
}

template <class Vector, class Number>
inline void store(Number* to, const Vector& v) {
  static_assert(sizeof v == LANES * sizeof(Number));
  std::memcpy(to, &v, sizeof v);
}

inline Float4 all(float value) { return Float4{value, value, value, value}; }

inline Float4 select(Int4 condition, Float4 yes, Float4 no) { return condition ? yes : no; }

// Lane by lane: a if it is less than b, else b.
inline Float4 lesser(Float4 a, Float4 b) {
#if defined(__SSE2__)
  return reinterpret_cast<Float4>(
      _mm_min_ps(reinterpret_cast<__m128>(a), reinterpret_cast<__m128>(b)));
#else
  return select(a < b, a, b);
#endif
}

// Four records of x, y, z in a row, taken apart.
struct Float4x3 {
  Float4 x, y, z;

  explicit Float4x3(const float* from) {
    const Float4 a = load(from), b = load(from + LANES), c = load(from + 2 * LANES);
    const Float4 ab = __builtin_shufflevector(a, b, 0, 3, 6, 1);  // x0 x1 x2 y0
    const Float4 bc = __builtin_shufflevector(b, c, 0, 3, 6, 1);  // y1 y2 y3 z1
    x = __builtin_shufflevector(ab, c, 0, 1, 2, 5);
    y = __builtin_shufflevector(ab, bc, 3, 4, 5, 6);
    z = __builtin_shufflevector(__builtin_shufflevector(a, bc, 2, 7, 2, 7), c, 0, 1, 4, 7);
  }
};

inline Float4 absolute(Float4 v) {
  return reinterpret_cast<Float4>(reinterpret_cast<Int4>(v) & 0x7fffffff);
}

// Two doubles at once.
inline Double2 load2(const double* from) {
  Double2 v;
  std::memcpy(&v, from, sizeof v);
  return v;
}

inline Double2 both(double value) { return Double2{value, value}; }

inline Double2 select(Long2 condition, Double2 yes, Double2 no) { return condition ? yes : no; }

inline Double2 absolute(Double2 v) {
  return reinterpret_cast<Double2>(reinterpret_cast<Long2>(v) & 0x7fffffffffffffff);
}

inline Double2 lesser(Double2 a, Double2 b) {
#if defined(__SSE2__)
  return reinterpret_cast<Double2>(
      _mm_min_pd(reinterpret_cast<__m128d>(a), reinterpret_cast<__m128d>(b)));
#else
  return select(a < b, a, b);
#endif
}

inline Float4 square_root(Float4 v) {
#if defined(__SSE2__)
  return reinterpret_cast<Float4>(_mm_sqrt_ps(reinterpret_cast<__m128>(v)));
#else
  for (std::size_t i = 0; i < LANES; ++i) v[i] = std::sqrt(v[i]);
  return v;
#endif
}

// The lanes of a condition (0 or -1) as bits, the first lane's lowest.
inline unsigned bits(Int4 condition) {
#if defined(__SSE2__)
  return static_cast<unsigned>(_mm_movemask_ps(reinterpret_cast<__m128>(condition)));
#else
  const Int4 own = condition & Int4{1, 2, 4, 8};
  return static_cast<unsigned>(own[0] | own[1] | own[2] | own[3]);
#endif
}

// The azimuth of (x, y), within 3e-6 rad: a minimax polynomial of atan on [0, 1] and three
// reflections. (0, 0) gives 0.
inline Float4 fast_atan2(Float4 y, Float4 x) {
  constexpr float pi = std::numbers::pi_v<float>;
  const Float4 ax = absolute(x), ay = absolute(y);
  const Int4 steep = ax < ay;
  const Float4 large = select(steep, ay, ax);
  const Float4 z = select(steep, ax, ay) / select(large > 0.0F, large, all(1.0F));
  const Float4 s = z * z;
  Float4 angle = all(-0.0117191266F);
  angle = angle * s + 0.0526473273F;
  angle = angle * s - 0.116426459F;
  angle = angle * s + 0.193540367F;
  angle = angle * s - 0.332622826F;
  angle = (angle * s + 0.999977219F) * z;
  angle = select(steep, 0.5F * pi - angle, angle);
  angle = select(x < 0.0F, pi - angle, angle);
  return select(y < 0.0F, -angle, angle);
}

}  // namespace twinscrew
