// Python bindings of the route planner: check the arguments, call the pure C++ core.
#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>

#include <cmath>
#include <vector>

#include "arrays.hpp"
#include "route.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace twinscrew {
namespace {

using Pair = std::array<double, 2>;

std::vector<Segment> segments(const In<-1, 2, 2>& rows) {
  std::vector<Segment> found(rows.shape(0));
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double* row = rows.data() + 4 * i;
    for (std::size_t k = 0; k < 4; ++k) require(std::isfinite(row[k]), "RoutePlanner: finite places");
    found[i] = {{row[0], row[1]}, {row[2], row[3]}};
  }
  return found;
}

Place place(const Pair& p) {
  require(std::isfinite(p[0]) && std::isfinite(p[1]), "RoutePlanner: finite places");
  return {p[0], p[1]};
}

}  // namespace

void bind_route(nb::module_& m) {
  nb::class_<RoutePlanner>(m, "RoutePlanner", "The cheapest way around what is fixed.")
      .def(
          "__init__",
          [](RoutePlanner* self, double least, double wanted, double nearness, double finest,
             double coarsest, double drift_s, double escape, std::size_t most) {
            require(least >= 0.0 && wanted > least && nearness >= 0.0 && finest > 0.0 &&
                        coarsest >= finest && drift_s >= 0.0 && escape >= 0.0,
                    "RoutePlanner: 0 <= least < wanted, 0 < finest <= coarsest");
            new (self) RoutePlanner(
                {least, wanted, nearness, finest, coarsest, drift_s, escape, most});
          },
          nb::kw_only(), "least"_a, "wanted"_a, "nearness"_a, "finest"_a, "coarsest"_a,
          "drift_s"_a, "escape"_a, "most"_a)
      .def(
          "divide",
          [](RoutePlanner& self, In<-1, 2, 2> shores, In<-1, 2, 2> walls, const Pair& low,
             double side) {
            require(side > 0.0 && side < 1e7, "RoutePlanner: a side in (0, 1e7) m");
            const auto closed = segments(shores), open = segments(walls);
            const Place corner = place(low);
            const nb::gil_scoped_release release;
            return self.divide(closed, open, corner, side);
          },
          "shores"_a, "walls"_a, "low"_a, "side"_a)
      .def_prop_ro("size", &RoutePlanner::size)
      .def("covers", [](const RoutePlanner& self, const Pair& p) { return self.covers(place(p)); },
           "place"_a)
      .def(
          "clearance",
          [](const RoutePlanner& self, const Pair& a, const Pair& b) {
            return self.clearance(place(a), place(b));
          },
          "a"_a, "b"_a)
      .def(
          "leg",
          [](const RoutePlanner& self, const Pair& a, const Pair& b) {
            return self.leg(place(a), place(b));
          },
          "a"_a, "b"_a)
      .def(
          "find",
          [](RoutePlanner& self, const Pair& start, const Pair& goal, const Pair& drift) {
            const Place from = place(start), to = place(goal), by = place(drift);
            Route route;
            {
              const nb::gil_scoped_release release;
              route = self.find(from, to, by);
            }
            return nb::make_tuple(
                static_cast<int>(route.end),
                make_array<double>({route.places.size(), 2},
                                   [&](double* out) {
                                     for (const Place& p : route.places) *out++ = p.x, *out++ = p.y;
                                   }),
                route.cost, route.expanded);
          },
          "start"_a, "goal"_a, "drift"_a);
}

}  // namespace twinscrew
