// Python bindings of the joint association: check the arguments, call the pure C++ core.
#include <nanobind/stl/array.h>

#include "arrays.hpp"
#include "joint.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace twinscrew {
namespace {

// (2, K, M): squared distances, infinite beyond the gate, and densities [1/m^d].
Given<double> pair_fits(In<-1, 6> x, In<-1, 6, 6> P, In<-1, -1> z, In<-1, -1, 6> H,
                        In<-1, -1, -1> R, In<-1> R_rad2, const std::array<double, 2>& origin,
                        double gate) {
  const std::size_t tracks = x.shape(0), detections = z.shape(0), d = z.shape(1);
  require(d == 1 || d == 2, "pair_fits: detections have one or two numbers");
  require(P.shape(0) == tracks && H.shape(0) == detections && H.shape(1) == d &&
              R.shape(0) == detections && R.shape(1) == d && R.shape(2) == d &&
              R_rad2.size() == detections,
          "pair_fits: x, P of each track; z, H, R, R_rad2 of each detection");
  const MeasurementRows look{{z.data(), z.size()},
                      {H.data(), H.size()},
                      {R.data(), R.size()},
                      {R_rad2.data(), R_rad2.size()},
                      origin};
  return make_array<double>({2, tracks, detections}, [&](double* out) {
    for (std::size_t k = 0; k < tracks; ++k) {
      const double *state = x.data() + STATE * k, *cov = P.data() + STATE * STATE * k;
      for (std::size_t m = 0; m < detections; ++m, ++out) {
        const PairFit fit = d == 1 ? pair_fit<1>(state, cov, look, m, gate * gate)
                                   : pair_fit<2>(state, cov, look, m, gate * gate);
        out[0] = fit.distance2;
        out[tracks * detections] = fit.density;
      }
    }
  });
}

// (K, 42): the mean and the covariance, row by row, of each track's mixture.
Given<double> mixtures(In<-1, 6> x, In<-1, 6, 6> P, In<-1, -1> z, In<-1, -1, 6> H,
                       In<-1, -1, -1> R, In<-1> R_rad2, const std::array<double, 2>& origin,
                       In<-1, -1> shares) {
  const std::size_t tracks = x.shape(0), detections = z.shape(0), d = z.shape(1);
  require(d == 1 || d == 2, "mixtures: detections have one or two numbers");
  require(P.shape(0) == tracks && H.shape(0) == detections && H.shape(1) == d &&
              R.shape(0) == detections && R.shape(1) == d && R.shape(2) == d &&
              R_rad2.size() == detections && shares.shape(0) == tracks &&
              shares.shape(1) == detections,
          "mixtures: x, P of each track; z, H, R, R_rad2 of each detection; a share of each pair");
  const MeasurementRows look{{z.data(), z.size()},
                      {H.data(), H.size()},
                      {R.data(), R.size()},
                      {R_rad2.data(), R_rad2.size()},
                      origin};
  std::vector<std::pair<double, Gaussian>> updates;
  return make_array<double>({tracks, STATE + STATE * STATE}, [&](double* out) {
    for (std::size_t k = 0; k < tracks; ++k) {
      const double *state = x.data() + STATE * k, *cov = P.data() + STATE * STATE * k;
      const std::span<const double> mine{shares.data() + detections * k, detections};
      const Gaussian mixed = d == 1 ? mixture<1>(state, cov, look, mine, updates)
                                    : mixture<2>(state, cov, look, mine, updates);
      out = std::copy(mixed.x.begin(), mixed.x.end(), out);
      out = std::copy(mixed.P.begin(), mixed.P.end(), out);
    }
  });
}

Given<bool> targets_shadowed(In<-1, 2> offsets, Array<const bool, -1> hides, double width) {
  const std::size_t size = offsets.shape(0);
  require(hides.size() == size, "shadowed: whether each target hides others");
  return make_array<bool>({size}, [&](bool* out) {
    shadowed({offsets.data(), 2 * size}, {hides.data(), size}, width, {out, size});
  });
}

Given<double> marginals(In<-1, -1> weights) {
  const std::size_t tracks = weights.shape(0), detections = weights.shape(1);
  return make_array<double>({tracks, detections}, [&](double* out) {
    association_marginals({weights.data(), weights.size()}, tracks, detections,
                          {out, tracks * detections});
  });
}

}  // namespace

void bind_joint(nb::module_& m) {
  m.def("pair_fits", &pair_fits, "x"_a, "P"_a, "z"_a, "H"_a, "R"_a, "R_rad2"_a, "origin"_a,
        "gate"_a, "Squared distances and densities of all pairs of tracks and detections.");
  m.def("mixtures", &mixtures, "x"_a, "P"_a, "z"_a, "H"_a, "R"_a, "R_rad2"_a, "origin"_a,
        "shares"_a, "Mean and covariance of each track's mixture of updates.");
  m.def("shadowed", &targets_shadowed, "offsets"_a, "hides"_a, "width"_a,
        "Which targets lie behind one that hides others.");
  m.def("association_marginals", &marginals, "weights"_a,
        "Probabilities of pairs, given their weights against no detection.");
}

}  // namespace twinscrew
