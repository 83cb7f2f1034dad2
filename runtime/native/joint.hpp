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

}  // namespace twinscrew
