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

// Two doubles at once.
inline Double2 load2(const double* from) {
  Double2 v;
  std::memcpy(&v, from, sizeof v);
  return v;
}

inline Double2 first_two(Float4 v) {
#if defined(__SSE2__)
  return reinterpret_cast<Double2>(_mm_cvtps_pd(reinterpret_cast<__m128>(v)));
#else
  return Double2{v[0], v[1]};
#endif
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

// The lanes of a condition (0 or -1) as bits, the first lane's lowest.
inline unsigned bits(Int4 condition) {
#if defined(__SSE2__)
  return static_cast<unsigned>(_mm_movemask_ps(reinterpret_cast<__m128>(condition)));
#else
  const Int4 own = condition & Int4{1, 2, 4, 8};
  return static_cast<unsigned>(own[0] | own[1] | own[2] | own[3]);
#endif
}

}  // namespace twinscrew
