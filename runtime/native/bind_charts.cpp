// Python bindings of routes and of what is learnt: check the arguments, call the pure C++ core.
#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>

#include <cmath>
#include <vector>

#include "arrays.hpp"
#include "learnt.hpp"
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
    for (std::size_t k = 0; k < 4; ++k) require(std::isfinite(row[k]), "segments: finite places");
    found[i] = {{row[0], row[1]}, {row[2], row[3]}};
  }
  return found;
}

Place place(const Pair& p) {
  require(std::isfinite(p[0]) && std::isfinite(p[1]), "a place: finite numbers");
  return {p[0], p[1]};
}

Given<double> as_array(const std::vector<Segment>& rows) {
  return make_array<double>({rows.size(), 2, 2}, [&](double* out) {
    for (const auto& [a, b] : rows) *out++ = a.x, *out++ = a.y, *out++ = b.x, *out++ = b.y;
  });
}

// [m] (L,) From each leg to the nearest wall; infinite without walls.
Given<double> legs_clearance(In<-1, 2, 2> legs, In<-1, 2, 2> walls) {
  const auto ways = segments(legs), fixed = segments(walls);
  return make_array<double>({ways.size()}, [&](double* out) {
    for (const Segment& way : ways) {
      double least = RoutePlanner::INFINITE;
      for (const Segment& wall : fixed) least = std::min(least, way.distance2(wall));
      *out++ = std::sqrt(least);
    }
  });
}

void see(LearntMap& self, const FreeWater* water, In<-1, 2> boundary, In<-1> heights,
         Array<const std::int64_t, -1> seen, Array<const std::uint8_t, -1> stands,
         const Pair& sensor, const Pair& own, double heading, double time) {
  const std::size_t size = boundary.shape(0);
  require(heights.size() == size && seen.size() == size,
          "LearntMap: a height and a number for each sight");
  require(std::isfinite(heading) && std::isfinite(time), "LearntMap: finite numbers");
  self.see({water,
            {boundary.data(), 2 * size},
            {heights.data(), size},
            {seen.data(), size},
            {stands.data(), stands.size()},
            place(sensor),
            place(own),
            heading,
            time});
}

}  // namespace

void bind_charts(nb::module_& m) {
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
            self.divide(closed, open, corner, side);
          },
          "shores"_a, "walls"_a, "low"_a, "side"_a)
      .def_prop_ro("size", &RoutePlanner::size)
      .def("covers", [](const RoutePlanner& self, const Pair& p) { return self.covers(place(p)); },
           "place"_a)
      .def(
          "clearance",
          [](RoutePlanner& self, const Pair& a, const Pair& b) {
            return self.clearance(place(a), place(b));
          },
          "a"_a, "b"_a)
      .def(
          "leg",
          [](RoutePlanner& self, const Pair& a, const Pair& b) {
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
  m.def("legs_clearance", &legs_clearance, "legs"_a, "walls"_a,
        "How far each leg is from the nearest wall.");
  nb::class_<LearntMap>(m, "LearntMap", "Walls and free water around the vessel, as seen so far.")
      .def(
          "__init__",
          [](LearntMap* self, double cell, std::int32_t size, int certain, int most, double margin,
             double height, double keep_s) {
            require(cell > 0.0 && size >= 8 && size <= 4096 && certain >= 1 && most >= certain,
                    "LearntMap: cells, 8 to 4096 a side; 1 <= certain <= most");
            new (self) LearntMap({cell, size, certain, most, margin, height, keep_s});
          },
          nb::kw_only(), "cell"_a, "size"_a, "certain"_a, "most"_a, "margin"_a, "height"_a,
          "keep_s"_a)
      .def("reset", &LearntMap::reset)
      .def("see", &see, nb::kw_only(), nb::arg("water").none(), "boundary"_a, "heights"_a, "seen"_a, "stands"_a,
           "sensor"_a, "own"_a, "heading"_a, "time"_a)
      .def_prop_ro("version", &LearntMap::version)
      .def_prop_ro("known", &LearntMap::known)
      .def("segments", [](const LearntMap& self) { return as_array(self.segments()); })
      .def("free_at", [](const LearntMap& self, const Pair& p) { return self.free_at(place(p)); },
           "place"_a)
      .def("wall_at", [](const LearntMap& self, const Pair& p) { return self.wall_at(place(p)); },
           "place"_a);
}

}  // namespace twinscrew
