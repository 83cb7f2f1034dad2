// Python bindings of tracking: check the arguments, call the pure C++ core.
#include <nanobind/stl/array.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <type_traits>

#include "arrays.hpp"
#include "centroids.hpp"
#include "free_water.hpp"
#include "shift.hpp"
#include "small.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace twinscrew {
namespace {

using Numbers = Array<const std::int64_t, -1>;

Shift find_shift(ShiftFinder& finder, In<-1, 4> before, In<-1, 4> after, const Pair2& guess,
                 const Pair2& centre, double turn) {
  require(turn > 0.0, "ShiftFinder: turn must be positive");
  return finder({before.data(), before.size()}, {after.data(), after.size()}, guess, centre, turn);
}

Given<double> invert_stack(In<-1, -1, -1> matrices) {
  const std::size_t count = matrices.shape(0), n = matrices.shape(1);
  require(matrices.shape(2) == n && n >= 1 && n <= 8,
          "invert_stack: square matrices of at most 8 rows");
  return make_array<double>({count, n, n}, [&](double* out) {
    for (std::size_t i = 0; i < count * n * n; i += n * n) {
      invert_symmetric(matrices.data() + i, out + i, n, n);
    }
  });
}

std::vector<std::vector<std::int64_t>> crowded_circles(In<-1, 2> places, In<-1, 2> centres,
                                                       In<-1> radii) {
  require(centres.shape(0) == radii.size(), "crowded: a radius for each centre");
  return crowded({places.data(), places.size()}, {centres.data(), centres.size()},
                 {radii.data(), radii.size()});
}

// down: the sensor's z axis; begin: where it is (3,), z down, levelled frame B.
Beams beams_of(In<-1> elevations, const std::array<double, 3>& begin,
               const std::array<double, 3>& down, double least) {
  require(down[2] > 0.1, "FreeWater: the sensor's z axis points down, more or less");
  const double length = std::hypot(down[0], down[1], down[2]);
  Beams beams{{}, {down[0] / length, down[1] / length, down[2] / length}, -begin[2], least};
  for (std::size_t i = 0; i < elevations.size(); ++i) {
    beams.sines.push_back(std::sin(elevations.data()[i]));
  }
  return beams;
}

void make_free_water(FreeWater* self, In<-1, 2> boundary, In<-1> heights, Numbers seen,
                     const std::array<double, 3>& begin, double sector, double guard,
                     bool is_closed, In<-1> elevations, const std::array<double, 3>& down,
                     double least) {
  const std::size_t size = boundary.shape(0);
  require(heights.size() == size && seen.size() == size,
          "FreeWater: a height and a number for each sight");
  require(sector > 0.0 && guard >= 0.0, "FreeWater: needs a sector's width, and no negative guard");
  require(std::isfinite(begin[0]) && std::isfinite(begin[1]), "FreeWater: begins somewhere");
  std::vector<BoundaryEnd> rows;
  rows.reserve(size);
  for (std::size_t i = 0; i < size; ++i) {
    const bool is_echo = !std::isnan(heights.data()[i]);
    rows.push_back({boundary.data()[2 * i], boundary.data()[2 * i + 1], is_echo, seen.data()[i]});
  }
  new (self) FreeWater(rows, begin[0], begin[1], sector, guard, is_closed,
                       beams_of(elevations, begin, down, least));
}

// (L,) of each place 0 if nothing is known, 1 if it is free, 2 if taken; and by what, or -1.
nb::tuple ask_free_water(const FreeWater& water, In<-1, 2> places, In<-1> tops, double margin) {
  const std::size_t size = places.shape(0);
  require(tops.size() == size, "FreeWater: a height for each place");
  std::vector<FreeWater::Known> known(size);
  for (std::size_t i = 0; i < size; ++i) {
    known[i] = water.ask(places.data()[2 * i], places.data()[2 * i + 1], tops.data()[i], margin);
  }
  auto answers = make_array<std::int8_t>(
      {size}, [&](auto* out) { for (const auto& t : known) *out++ = t.answer; });
  auto object = make_array<std::int64_t>(
      {size}, [&](auto* out) { for (const auto& t : known) *out++ = t.object; });
  return nb::make_tuple(answers, object);
}

// (3, K, M): squared distances without and with the gate's allowance, log |S| with it; infinite
// where a distance is certainly greater than `most`.
Given<double> innovations(In<-1, 6> x, In<-1, 6, 6> P, In<-1, 2> z, In<-1, 2, 6> H, In<-1, 2, 2> R,
                          In<-1> gate, double most) {
  const std::size_t tracks = x.shape(0), seen = z.shape(0);
  require(P.shape(0) == tracks && H.shape(0) == seen && R.shape(0) == seen && gate.size() == seen,
          "innovations: x, P of each track, z, H, R, gate of each object");
  const Predicted predicted{{x.data(), x.size()}, {P.data(), P.size()}};
  const Measured measured{
      {z.data(), z.size()}, {H.data(), H.size()}, {R.data(), R.size()}, {gate.data(), seen}};
  return make_array<double>({3, tracks, seen}, [&](double* out) {
    for (std::size_t k = 0; k < tracks; ++k) {
      for (std::size_t m = 0; m < seen; ++m, ++out) {
        const Innovation found = innovation(predicted, measured, k, m, most * most);
        out[0] = found.strict2;
        out[tracks * seen] = found.distance2;
        out[2 * tracks * seen] = found.log_det;
      }
    }
  });
}


// One column of what was measured, an array of its own.
template <class Pick>
Given<double> column_of(const std::vector<CentroidRow>& rows,
                        std::initializer_list<std::size_t> shape, Pick pick) {
  return make_array<double>(shape, [&](double* out) {
    for (const CentroidRow& row : rows) {
      const auto& part = row.*pick;
      if constexpr (std::is_same_v<std::decay_t<decltype(part)>, double>) {
        *out++ = part;
      } else {
        out = std::copy(part.begin(), part.end(), out);
      }
    }
  });
}

// z, H, R, radius, gate of the objects that are finite, and which these are.
nb::tuple measured(const CentroidModel& model, In<-1, 2> p, In<-1> radius, Numbers points,
                   const std::array<double, 4>& viewpoint) {
  const std::size_t size = p.shape(0);
  require(radius.size() == size && points.size() == size,
          "CentroidModel: place, radius and points of each object");
  const Viewpoint own{viewpoint[0], viewpoint[1], viewpoint[2], viewpoint[3]};
  std::vector<CentroidRow> rows;
  nb::list kept;
  rows.reserve(size);
  for (std::size_t k = 0; k < size && own.finite(); ++k) {
    const double x = p.data()[2 * k], y = p.data()[2 * k + 1], r = radius.data()[k];
    if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(r)) continue;
    rows.push_back(model.row(x, y, r, points.data()[k], own));
    kept.append(k);
  }
  const std::size_t n = rows.size();
  return nb::make_tuple(
      column_of(rows, {n, 2}, &CentroidRow::z), column_of(rows, {n, 2, 6}, &CentroidRow::H),
      column_of(rows, {n, 2, 2}, &CentroidRow::R), column_of(rows, {n}, &CentroidRow::radius),
      column_of(rows, {n}, &CentroidRow::gate), kept);
}

// (K, 2) how far centroids of things may be off: a row begins with north and east [m]. Seen from
// nowhere, they are taken to be near.
Given<double> bias_variance(const CentroidModel& model, In<-1, -1> places, In<-1> radius,
                            double north, double east) {
  const std::size_t size = places.shape(0), width = places.shape(1);
  require(radius.size() == size && width >= 2, "CentroidModel: place and radius of each thing");
  return make_array<double>({size, 2}, [&](double* out) {
    for (std::size_t k = 0; k < size; ++k) {
      const double* p = places.data() + width * k;
      const double distance = std::hypot(p[0] - north, p[1] - east);
      const auto both = model.variance(std::isfinite(distance) ? distance : 0.0, radius.data()[k]);
      out = std::copy(both.begin(), both.end(), out);
    }
  });
}

void bind_shift(nb::module_& m) {
  nb::class_<Shift>(m, "Shift", "How far an object has moved.")
      .def_ro("pairs", &Shift::pairs)
      .def_ro("x", &Shift::x)
      .def_ro("y", &Shift::y)
      .def_ro("xx", &Shift::xx)
      .def_ro("xy", &Shift::xy)
      .def_ro("yy", &Shift::yy);
  nb::class_<FreeWater>(m, "FreeWater", "What a scan has shown of places on the water.")
      .def("__init__", &make_free_water, nb::kw_only(), "boundary"_a, "heights"_a, "seen"_a,
           "begin"_a, "sector"_a, "guard"_a, "is_closed"_a, "elevations"_a, "down"_a, "least"_a)
      .def("ask", &ask_free_water, "places"_a, "tops"_a, "margin"_a);
  nb::class_<ShiftFinder>(m, "ShiftFinder", "Finds strips again in the next scan.")
      .def(
          "__init__",
          [](ShiftFinder* self, double search, double length, double spacing, double sigma,
             double ends, double robust, int pairs) {
            new (self)
                ShiftFinder({search, length, spacing, sigma, ends, robust, std::max(pairs, 1)});
          },
          nb::kw_only(), "search"_a, "length"_a, "spacing"_a, "sigma"_a, "ends"_a, "robust"_a,
          "pairs"_a)
      .def("__call__", &find_shift, "before"_a, "after"_a, "guess"_a, "centre"_a, "turn"_a);
}

}  // namespace

void bind_tracking(nb::module_& m) {
  bind_shift(m);
  nb::class_<CentroidModel>(m, "CentroidModel", "What visible centroids say.")
      .def(
          "__init__",
          [](CentroidModel* self, const std::vector<double>& range,
             const std::vector<double>& depth, double small_depth, double buoy, double hull,
             double along, double across, double row_spread, double row, double sigma,
             double scatter, double jump, double edge, double edge_sigma) {
            require(!range.empty() && range.size() == depth.size() && buoy < hull,
                    "CentroidModel: a depth for each range, and radii that rise");
            new (self) CentroidModel({range, depth, small_depth, buoy, hull, along, across,
                                      row_spread, row, sigma, scatter, jump, edge, edge_sigma});
          },
          nb::kw_only(), "range"_a, "depth"_a, "small_depth"_a, "buoy"_a, "hull"_a, "along"_a,
          "across"_a, "row_spread"_a, "row"_a, "sigma"_a, "scatter"_a, "jump"_a, "edge"_a,
          "edge_sigma"_a)
      .def("measured", &measured, "p"_a, "radius"_a, "points"_a, "viewpoint"_a)
      .def("bias_variance", &bias_variance, "places"_a, "radius"_a, "north"_a, "east"_a);
  m.def("invert_stack", &invert_stack, "matrices"_a,
        "Invert symmetric positive definite matrices, (K, n, n), n at most 8.");
  m.def("crowded", &crowded_circles, "places"_a, "centres"_a, "radii"_a,
        "Which of the places lie within each of the circles that hold two or more.");
  m.def("innovations", &innovations, "x"_a, "P"_a, "z"_a, "H"_a, "R"_a, "gate"_a, "most"_a,
        "How far each measurement is from what each track expects.");
}

}  // namespace twinscrew
