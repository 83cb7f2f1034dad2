// Joint association: how likely each detection is one of each track's, and the probabilities of
// all pairs when no detection has two tracks and no track two detections.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

namespace twinscrew {

constexpr std::size_t STATE = 6;

// One look: M detections of D numbers each, with the noise that grows with the squared distance of
// the target from the origin.
struct MeasurementRows {
  std::span<const double> z, H, R, R_rad2;  // (M, D), (M, D, 6), (M, D, D), (M,)
  std::array<double, 2> origin;             // north, east [m]
};

struct PairFit {
  double distance2 = std::numeric_limits<double>::infinity();  // squared Mahalanobis distance [-]
  double density = 0.0;                                        // of the detection [1/m^D]
};

// The fit of one track, x (6,) and P (6, 6), and one detection.
template <std::size_t D>
PairFit pair_fit(const double* x, const double* P, const MeasurementRows& look, std::size_t m,
                 double gate2) {
  const double *z = &look.z[D * m], *H = &look.H[D * STATE * m], *R = &look.R[D * D * m];
  const double north = x[0] - look.origin[0], east = x[1] - look.origin[1];
  const double grown = look.R_rad2[m] * (north * north + east * east);
  std::array<double, D> y{};
  double y2 = 0.0, noise = D * grown;
  for (std::size_t a = 0; a < D; ++a) {
    y[a] = z[a];
    for (std::size_t i = 0; i < STATE; ++i) y[a] -= H[STATE * a + i] * x[i];
    y2 += y[a] * y[a];
    noise += R[D * a + a];
  }
  // S <= (noise + |H|^2 tr P) I, and |H|^2 <= 4 for rotated unit blocks: a cheap first gate.
  double trace = 0.0;
  for (std::size_t i = 0; i < STATE; ++i) trace += P[STATE * i + i];
  if (y2 > gate2 * (noise + 4.0 * trace)) return {};
  std::array<double, D * D> S{};
  for (std::size_t a = 0; a < D; ++a) {
    std::array<double, STATE> HP{};
    for (std::size_t i = 0; i < STATE; ++i) {
      for (std::size_t j = 0; j < STATE; ++j) HP[j] += H[STATE * a + i] * P[STATE * i + j];
    }
    for (std::size_t b = 0; b < D; ++b) {
      S[D * a + b] = R[D * a + b] + (a == b ? grown : 0.0);
      for (std::size_t j = 0; j < STATE; ++j) S[D * a + b] += HP[j] * H[STATE * b + j];
    }
  }
  PairFit fit;
  double det;
  if constexpr (D == 1) {
    // A line through the origin: what is behind the sensor cannot be meant.
    const double ahead = north * H[1] - east * H[0];
    if (ahead <= 0.0) return {};
    det = S[0];
    fit.distance2 = y[0] * y[0] / S[0];
  } else {
    det = S[0] * S[3] - S[1] * S[2];
    fit.distance2 = (S[3] * y[0] * y[0] + S[0] * y[1] * y[1] - (S[1] + S[2]) * y[0] * y[1]) / det;
  }
  if (!(fit.distance2 <= gate2)) return {};
  const double norm = std::pow(2.0 * std::numbers::pi, 0.5 * static_cast<double>(D));
  fit.density = std::exp(-0.5 * fit.distance2) / (norm * std::sqrt(det));
  return fit;
}

// Probabilities of pairs from their weights against "not detected", by loopy belief propagation:
// Williams and Lau (2014), Approximate evaluation of marginal association probabilities with
// belief propagation, IEEE Trans. AES 50(4), eqs. 29 to 33. Exact where the pairs form no loop.
//
// weights, out: (tracks, detections). A zero weight is no pair.
inline void association_marginals(std::span<const double> weights, std::size_t tracks,
                                  std::size_t detections, std::span<double> out) {
  struct Pair {
    std::size_t track, detection;
    double weight, to_detection, to_track;
  };
  std::vector<Pair> pairs;
  for (std::size_t k = 0; k < tracks; ++k) {
    for (std::size_t m = 0; m < detections; ++m) {
      const double w = weights[detections * k + m];
      if (w > 0.0) pairs.push_back({k, m, w, 0.0, 1.0});
    }
  }
  std::vector<double> of_track(tracks), of_detection(detections);
  constexpr int MOST = 200;
  constexpr double ENOUGH = 1e-9;
  for (int round = 0; round < MOST && !pairs.empty(); ++round) {
    std::fill(of_track.begin(), of_track.end(), 1.0);
    std::fill(of_detection.begin(), of_detection.end(), 1.0);
    for (const Pair& p : pairs) of_track[p.track] += p.weight * p.to_track;
    for (Pair& p : pairs) {
      p.to_detection = p.weight / (of_track[p.track] - p.weight * p.to_track);
      of_detection[p.detection] += p.to_detection;
    }
    double moved = 0.0;
    for (Pair& p : pairs) {
      const double next = 1.0 / (of_detection[p.detection] - p.to_detection);
      moved = std::max(moved, std::abs(next - p.to_track));
      p.to_track = next;
    }
    if (moved < ENOUGH) break;
  }
  std::fill(out.begin(), out.end(), 0.0);
  std::fill(of_track.begin(), of_track.end(), 1.0);
  for (const Pair& p : pairs) of_track[p.track] += p.weight * p.to_track;
  for (const Pair& p : pairs) {
    out[detections * p.track + p.detection] = p.weight * p.to_track / of_track[p.track];
  }
}

// One track's Gaussian, x (6,) and P (6, 6) row by row.
struct Gaussian {
  std::array<double, STATE> x{};
  std::array<double, STATE * STATE> P{};
};

// The Kalman update of a track by detection m, with the covariance in Joseph's form:
// Bar-Shalom, Li, Kirubarajan (2001), Estimation with Applications to Tracking and Navigation,
// eqs. 5.2.3-12 and 5.2.3-18.
template <std::size_t D>
Gaussian updated(const double* x, const double* P, const MeasurementRows& look, std::size_t m) {
  const double *z = &look.z[D * m], *H = &look.H[D * STATE * m];
  const double north = x[0] - look.origin[0], east = x[1] - look.origin[1];
  std::array<double, D * D> R{}, S{};
  std::array<double, STATE * D> PHT{}, K{};
  std::array<double, D> y{};
  for (std::size_t a = 0; a < D; ++a) {
    y[a] = z[a];
    for (std::size_t i = 0; i < STATE; ++i) {
      y[a] -= H[STATE * a + i] * x[i];
      for (std::size_t j = 0; j < STATE; ++j) {
        PHT[D * i + a] += P[STATE * i + j] * H[STATE * a + j];
      }
    }
    for (std::size_t b = 0; b < D; ++b) R[D * a + b] = look.R[D * D * m + D * a + b];
    R[D * a + a] += look.R_rad2[m] * (north * north + east * east);
  }
  for (std::size_t a = 0; a < D; ++a) {
    for (std::size_t b = 0; b < D; ++b) {
      S[D * a + b] = R[D * a + b];
      for (std::size_t i = 0; i < STATE; ++i) S[D * a + b] += H[STATE * a + i] * PHT[D * i + b];
    }
  }
  std::array<double, D * D> SI{};
  if constexpr (D == 1) {
    SI[0] = 1.0 / S[0];
  } else {
    const double det = S[0] * S[3] - S[1] * S[2];
    SI = {S[3] / det, -S[1] / det, -S[2] / det, S[0] / det};
  }
  Gaussian out;
  std::array<double, STATE * STATE> A{}, AP{};  // A = I - K H
  for (std::size_t i = 0; i < STATE; ++i) {
    out.x[i] = x[i];
    for (std::size_t a = 0; a < D; ++a) {
      for (std::size_t b = 0; b < D; ++b) K[D * i + a] += PHT[D * i + b] * SI[D * b + a];
      out.x[i] += K[D * i + a] * y[a];
    }
    for (std::size_t j = 0; j < STATE; ++j) {
      A[STATE * i + j] = i == j ? 1.0 : 0.0;
      for (std::size_t a = 0; a < D; ++a) A[STATE * i + j] -= K[D * i + a] * H[STATE * a + j];
    }
  }
  for (std::size_t i = 0; i < STATE; ++i) {
    for (std::size_t k = 0; k < STATE; ++k) {
      for (std::size_t j = 0; j < STATE; ++j) AP[STATE * i + j] += A[STATE * i + k] * P[STATE * k + j];
    }
  }
  for (std::size_t i = 0; i < STATE; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = 0.0;
      for (std::size_t k = 0; k < STATE; ++k) sum += AP[STATE * i + k] * A[STATE * j + k];
      for (std::size_t a = 0; a < D; ++a) {
        for (std::size_t b = 0; b < D; ++b) sum += K[D * i + a] * R[D * a + b] * K[D * j + b];
      }
      out.P[STATE * i + j] = out.P[STATE * j + i] = sum;
    }
  }
  return out;
}

// Mean and covariance of a track's mixture: of its updates by the detections with the
// probabilities `shares`, (M,), and of itself with what is missing from 1.
// Bar-Shalom et al. (2001), eqs. 1.4.16-7 and 1.4.16-9. `updates` is kept memory.
template <std::size_t D>
Gaussian mixture(const double* x, const double* P, const MeasurementRows& look,
                 std::span<const double> shares,
                 std::vector<std::pair<double, Gaussian>>& updates) {
  updates.clear();
  double rest = 1.0;
  for (std::size_t m = 0; m < shares.size(); ++m) {
    if (shares[m] <= 0.0) continue;
    rest -= shares[m];
    updates.emplace_back(shares[m], updated<D>(x, P, look, m));
  }
  Gaussian out;
  rest = std::max(rest, 0.0);
  for (std::size_t i = 0; i < STATE; ++i) {
    out.x[i] = rest * x[i];
    for (const auto& [share, update] : updates) out.x[i] += share * update.x[i];
  }
  const auto add = [&out](double share, const double* x_part, const double* P_part) {
    for (std::size_t i = 0; i < STATE; ++i) {
      for (std::size_t j = 0; j < STATE; ++j) {
        const double spread = (x_part[i] - out.x[i]) * (x_part[j] - out.x[j]);
        out.P[STATE * i + j] += share * (P_part[STATE * i + j] + spread);
      }
    }
  };
  add(rest, x, P);
  for (const auto& [share, update] : updates) add(share, update.x.data(), update.P.data());
  return out;
}

// Which targets, at offsets (K, 2) from the sensor, lie behind one that hides others? Behind is 3 m
// farther away, and within `width` beside the line of sight at the distance of what hides.
inline void shadowed(std::span<const double> offsets, std::span<const bool> hides, double width,
                     std::span<bool> out) {
  const std::size_t size = hides.size();
  std::vector<double> distance(size);
  for (std::size_t k = 0; k < size; ++k) {
    distance[k] = std::hypot(offsets[2 * k], offsets[2 * k + 1]);
  }
  constexpr double LEAST = 1e-6, FARTHER = 3.0;
  for (std::size_t k = 0; k < size; ++k) {
    out[k] = false;
    for (std::size_t n = 0; n < size && !out[k]; ++n) {
      if (!hides[n] || !(distance[k] > distance[n] + FARTHER)) continue;
      const double scale = std::max(distance[n], LEAST);
      const double u = offsets[2 * n] / scale, v = offsets[2 * n + 1] / scale;
      const double along = offsets[2 * k] * u + offsets[2 * k + 1] * v;
      const double across = std::abs(offsets[2 * k + 1] * u - offsets[2 * k] * v);
      out[k] = along > 0.0 && across * distance[n] / std::max(distance[k], LEAST) < width;
    }
  }
}

}  // namespace twinscrew
