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
  m.def("association_marginals", &marginals, "weights"_a,
        "Probabilities of pairs, given their weights against no detection.");
}

}  // namespace twinscrew
