// Inverses of small symmetric matrices, what lies within which circle, and how likely measurements
// are: what a tracker asks for many times a scan, and what takes numpy longer to call than to do.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace twinscrew {

// The inverse of a symmetric positive definite matrix of `n` rows within a larger one, by
// L D L^T: `in` and `out` begin at its first element, `stride` apart from row to row.
template <std::size_t MOST = 8>
inline void invert_symmetric(const double* in, double* out, std::size_t n, std::size_t stride) {
  std::array<double, MOST * MOST> l{}, inverse{};
  std::array<double, MOST> d{};
  for (std::size_t j = 0; j < n; ++j) {
    d[j] = in[j * stride + j];
    for (std::size_t k = 0; k < j; ++k) d[j] -= l[j * MOST + k] * l[j * MOST + k] * d[k];
    for (std::size_t i = j + 1; i < n; ++i) {
      double sum = in[i * stride + j];
      for (std::size_t k = 0; k < j; ++k) sum -= l[i * MOST + k] * l[j * MOST + k] * d[k];
      l[i * MOST + j] = sum / d[j];
    }
  }
  for (std::size_t j = 0; j < n; ++j) {  // the inverse of L, column by column
    inverse[j * MOST + j] = 1.0;
    for (std::size_t i = j + 1; i < n; ++i) {
      for (std::size_t k = j; k < i; ++k) {
        inverse[i * MOST + j] -= l[i * MOST + k] * inverse[k * MOST + j];
      }
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = 0.0;
      for (std::size_t k = i; k < n; ++k) {
        sum += inverse[k * MOST + i] * inverse[k * MOST + j] / d[k];
      }
      out[i * stride + j] = out[j * stride + i] = sum;
    }
  }
}

// Which of the places, (N, 2), lie within each circle, (K, 2) and (K,), that holds two or more?
inline std::vector<std::vector<std::int64_t>> crowded(std::span<const double> places,
                                                      std::span<const double> centres,
                                                      std::span<const double> radii) {
  std::vector<std::vector<std::int64_t>> groups;
  std::vector<std::int64_t> within;
  for (std::size_t k = 0; k < radii.size(); ++k) {
    within.clear();
    for (std::size_t i = 0; i < places.size(); i += 2) {
      const double x = places[i] - centres[2 * k], y = places[i + 1] - centres[2 * k + 1];
      if (std::abs(x) <= radii[k] && std::abs(y) <= radii[k] && std::hypot(x, y) <= radii[k]) {
        within.push_back(static_cast<std::int64_t>(i / 2));
      }
    }
    if (within.size() > 1) groups.push_back(within);
  }
  return groups;
}

// What a tracker knows, and what a scan says of it.
struct Predicted {
  std::span<const double> x, P;  // (K, 6), (K, 6, 6)
};
struct Measured {
  std::span<const double> z, H, R, gate;  // (M, 2), (M, 2, 6), (M, 2, 2), (M,)
};
struct Innovation {
  double strict2, distance2, log_det;  // [-] without the gate's allowance; with it
};

// Of track k and measurement m; infinitely far where it is far beyond the gate, squared.
inline Innovation innovation(const Predicted& tracks, const Measured& measured, std::size_t k,
                             std::size_t m, double gate2) {
  constexpr std::size_t N = 6;
  const double *x = &tracks.x[N * k], *P = &tracks.P[N * N * k], *H = &measured.H[2 * N * m];
  const double *z = &measured.z[2 * m], *R = &measured.R[4 * m];
  std::array<double, 2> y{z[0], z[1]};
  std::array<double, 4> S{R[0], R[1], R[2], R[3]};
  for (std::size_t a = 0; a < 2; ++a) {
    for (std::size_t i = 0; i < N; ++i) y[a] -= H[N * a + i] * x[i];
  }
  // S <= (tr R + |H|^2 tr P + gate) I, and |H|^2 <= 2 for a place and a rotated bias.
  double most = R[0] + R[3] + measured.gate[m];
  for (std::size_t i = 0; i < N; ++i) most += 4.0 * P[N * i + i];
  if (y[0] * y[0] + y[1] * y[1] > gate2 * most) {
    constexpr double far = std::numeric_limits<double>::infinity();
    return {far, far, 0.0};
  }
  for (std::size_t a = 0; a < 2; ++a) {
    std::array<double, N> HP{};
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t j = 0; j < N; ++j) HP[j] += H[N * a + i] * P[N * i + j];
    }
    for (std::size_t b = 0; b < 2; ++b) {
      for (std::size_t j = 0; j < N; ++j) S[2 * a + b] += HP[j] * H[N * b + j];
    }
  }
  const auto det = [&](double more) { return (S[0] + more) * (S[3] + more) - S[1] * S[2]; };
  const auto distance2 = [&](double more) {
    return ((S[3] + more) * y[0] * y[0] + (S[0] + more) * y[1] * y[1] -
            (S[1] + S[2]) * y[0] * y[1]) /
           det(more);
  };
  const double gate = measured.gate[m];
  return {distance2(0.0), distance2(gate), std::log(det(gate))};
}

}  // namespace twinscrew
