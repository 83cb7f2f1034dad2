// Python bindings of the assurance: check the arguments, call the pure C++ core.
#include <nanobind/stl/array.h>
#include <nanobind/stl/vector.h>

#include <limits>

#include "arrays.hpp"
#include "assurance.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace twinscrew {
namespace {

Surroundings surroundings(const In<-1, 2>& p, const In<-1, 2>& v, const In<-1>& radius,
                          const In<-1>& horizon) {
  const std::size_t size = radius.size();
  require(p.shape(0) == size && v.shape(0) == size && horizon.size() == size,
          "Foresight: p, v, radius and horizon of every circle");
  return {
      {p.data(), 2 * size}, {v.data(), 2 * size}, {radius.data(), size}, {horizon.data(), size}};
}

// Rows of x, y from, x, y to [m].
std::vector<Segment> pieces(const In<-1, 2, 2>& rows) {
  std::vector<Segment> found(rows.shape(0));
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double* row = rows.data() + 4 * i;
    found[i] = {{row[0], row[1]}, {row[2], row[3]}};
  }
  return found;
}

nb::tuple as_tuple(const Contact& c) {
  return nb::make_tuple(c.excess, c.time, c.speed, c.circle, c.to_starboard);
}

}  // namespace

void bind_assurance(nb::module_& m) {
  nb::class_<Law>(m, "Law", "What a manoeuvre wants of the propellers.")
      .def(
          "__init__",
          [](Law* self, const Thrusts& base, double gain, double low, double high) {
            new (self) Law{base, gain, low, high};
          },
          "base"_a, "gain"_a = 0.0, "low"_a = -std::numeric_limits<double>::infinity(),
          "high"_a = std::numeric_limits<double>::infinity())
      .def(
          "after",
          [](Law law, const Thrusts& first, double until) {
            law.first = first;
            law.until = until;
            return law;
          },
          "first"_a, "until"_a, "The same, but something else for a while.")
      .def(
          "__call__",
          [](const Law& law, double time, double surge) {
            const auto [left, right] = law(time, surge);
            return nb::make_tuple(left, right);
          },
          "time"_a, "surge"_a);
  nb::class_<Foresight>(m, "Foresight", "Where manoeuvres lead, and into contact with what.")
      .def(
          "__init__",
          [](Foresight* self, const std::array<Planar, 3>& vessel, double lever,
             const std::vector<Thrusts>& hull, const std::vector<Thrusts>& close_hull, int steps, double dt, double slew, double margin,
             double approach) {
            require(steps >= 1 && dt > 0.0 && !hull.empty(),
                    "Foresight: a step, a time and a hull at least");
            std::vector<HullCircle> circles;
            for (const auto& [ahead, radius] : hull) circles.push_back({ahead, radius});
            std::vector<HullCircle> close;
            for (const auto& [ahead, radius] : close_hull) close.push_back({ahead, radius});
            new (self) Foresight({vessel[0], vessel[1], vessel[2], lever}, circles,
                                 {steps, dt, slew, margin, approach}, close);
          },
          nb::kw_only(), "vessel"_a, "lever"_a, "hull"_a, "close_hull"_a, "steps"_a, "dt"_a, "slew"_a, "margin"_a,
          "approach"_a)
      .def(
          "acceleration",
          [](const Foresight& self, const Planar& motion, const Thrusts& thrust) {
            const auto [surge, sway, yaw] = self.acceleration(motion, thrust);
            return nb::make_tuple(surge, sway, yaw);
          },
          "motion"_a, "thrust"_a)
      .def(
          "path",
          [](Foresight& self, const Planar& motion, const Thrusts& thrust, const Law& law,
             const Push& push) {
            const auto path = self.sail(motion, thrust, law, push);
            return make_array<double>({path.size(), 3}, [&](double* out) {
              for (const Planar& pose : path) out = std::copy(pose.begin(), pose.end(), out);
            });
          },
          "motion"_a, "thrust"_a, "law"_a, "push"_a)
      .def(
          "contact",
          [](Foresight& self, In<-1, 3> path, In<-1, 2> p, In<-1, 2> v, In<-1> radius,
             In<-1> horizon, In<-1, 2, 2> shores, double clearance, double margin, double until) {
            std::vector<Planar> poses(path.shape(0));
            for (std::size_t i = 0; i < 3 * poses.size(); ++i) poses[i / 3][i % 3] = path.data()[i];
            const auto fixed = pieces(shores);
            return as_tuple(self.judge(poses, surroundings(p, v, radius, horizon),
                                       {fixed, clearance, margin, until}));
          },
          "path"_a, "p"_a, "v"_a, "radius"_a, "horizon"_a, "shores"_a, "clearance"_a, "margin"_a, "until"_a)
      .def(
          "judge",
          [](Foresight& self, const Planar& motion, const Thrusts& thrust, const Law& law,
             const Push& push, In<-1, 2> p, In<-1, 2> v, In<-1> radius, In<-1> horizon,
             In<-1, 2, 2> shores, double clearance, double margin, double until) {
            const Surroundings around = surroundings(p, v, radius, horizon);
            const auto fixed = pieces(shores);
            return as_tuple(self.judge(self.sail(motion, thrust, law, push), around,
                                       {fixed, clearance, margin, until}));
          },
          "motion"_a, "thrust"_a, "law"_a, "push"_a, "p"_a, "v"_a, "radius"_a, "horizon"_a,
          "shores"_a, "clearance"_a, "margin"_a, "until"_a);
}

}  // namespace twinscrew
