// Python bindings: check the arguments, release the GIL, call the pure C++ core.
#include "arrays.hpp"
#include "raycast.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace twinscrew {
namespace {

using Vector = In<-1>;
using Vectors3 = In<-1, 3>;
using Matrices3 = In<-1, 3, 3>;
using Numbers = Array<const std::int32_t, -1>;

Pose pose(const double* R, const double* p) {
  Pose X;
  std::copy_n(R, 9, X.R.begin());
  std::copy_n(p, 3, X.p.begin());
  return X;
}

template <typename T>
std::span<T> span(const Array<T, -1>& a) {
  return {a.data(), a.size()};
}

Caster make_caster(Vector elevations, Vector azimuths, double range_min_m, double range_max_m) {
  require(elevations.size() > 0 && azimuths.size() > 0, "a sensor needs at least one beam");
  require(finite(elevations) && finite(azimuths), "beam angles must be finite");
  require(range_min_m >= 0 && range_max_m > range_min_m, "need 0 <= range_min_m < range_max_m");
  return {Beams(span(elevations), span(azimuths)), range_min_m, range_max_m};
}

std::size_t add_shape(Caster& caster, Numbers kinds, Vectors3 centres, Matrices3 rotations,
                      Vectors3 halves) {
  const std::size_t count = kinds.size();
  require(centres.shape(0) == count && rotations.shape(0) == count && halves.shape(0) == count,
          "kinds, centres, rotations and halves must have the same length");
  require(finite(centres) && finite(rotations) && finite(halves), "a shape must be finite");
  Shape shape;
  for (std::size_t i = 0; i < count; ++i) {
    require(kinds(i) == 0 || kinds(i) == 1, "a solid's kind is 0 (box) or 1 (cylinder)");
    const double* half = halves.data() + 3 * i;
    shape.push_back({static_cast<Kind>(kinds(i)), {half[0], half[1], half[2]},
                     pose(rotations.data() + 9 * i, centres.data() + 3 * i)});
  }
  return caster.add_shape(std::move(shape));
}

void add_plate(Caster& caster, std::size_t shape, double down_m, In<-1, 2> ring) {
  require(shape < caster.shapes(), "no such shape");
  require(ring.shape(0) >= 3, "a plate needs at least three corners");
  require(finite(ring) && std::isfinite(down_m), "a plate must be finite");
  std::array<double, 2> low{ring(0, 0), ring(0, 1)}, high = low;
  for (std::size_t i = 0; i < ring.shape(0); ++i) {
    for (std::size_t k = 0; k < 2; ++k) {
      low[k] = std::min(low[k], ring(i, k));
      high[k] = std::max(high[k], ring(i, k));
    }
  }
  const Vec3 centre{(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, down_m};
  Solid plate{Kind::kPlate,
              {(high[0] - low[0]) / 2, (high[1] - low[1]) / 2, 0},
              {{1, 0, 0, 0, 1, 0, 0, 0, 1}, centre}};
  for (std::size_t i = 0; i < ring.shape(0); ++i) {
    plate.ring.push_back({ring(i, 0) - centre[0], ring(i, 1) - centre[1]});
  }
  caster.add_to(shape, std::move(plate));
}

void mount(Caster& caster, std::size_t own_shape, In<3> p_BS, In<3, 3> R_BS) {
  require(own_shape < caster.shapes(), "no such shape");
  caster.mount(own_shape, pose(R_BS.data(), p_BS.data()));
}

std::size_t cast(Caster& caster, In<3> p_NS, In<3, 3> R_NS, Numbers shapes, Vectors3 p_NO,
                 Matrices3 R_NO, Vector water_z, std::size_t own, Array<std::int32_t, -1> beam,
                 Out<-1> distance, Array<std::int32_t, -1> body) {
  const std::size_t count = shapes.size();
  const std::size_t beams = caster.beams().rows() * caster.beams().columns();
  require(p_NO.shape(0) == count && R_NO.shape(0) == count && water_z.size() == count,
          "shapes, p_NO, R_NO and water_z must have the same length");
  require(own < count, "own must be the number of a body");
  require(beam.size() == beams && distance.size() == beams && body.size() == beams,
          "beam, distance and body must have one element a beam");
  require(finite(p_NS) && finite(R_NS) && finite(p_NO) && finite(R_NO), "poses must be finite");
  std::vector<Body> bodies;
  for (std::size_t i = 0; i < count; ++i) {
    require(shapes(i) < static_cast<std::int64_t>(caster.shapes()), "no such shape");
    bodies.push_back({shapes(i), pose(R_NO.data() + 9 * i, p_NO.data() + 3 * i), water_z(i)});
  }
  Echoes echoes{span(beam), span(distance), span(body)};
  const nb::gil_scoped_release release;
  return caster.cast(pose(R_NS.data(), p_NS.data()), bodies, own, echoes);
}

}  // namespace
}  // namespace twinscrew

namespace twinscrew {
void bind_vessel(nb::module_& m);  // bind_vessel.cpp
}

NB_MODULE(_native, m) {
  using namespace twinscrew;
  m.doc() = "The simulator's native kernels.";
  // A failing test's traceback holds objects until the interpreter ends; a list of them would drown
  // the failure.
  nb::set_leak_warnings(false);
  nb::class_<Caster>(m, "Caster", "A LiDAR's scan by ray casting; serves one thread at a time.")
      .def("__init__",
           [](Caster* self, Vector elevations, Vector azimuths, double range_min_m,
              double range_max_m) {
             new (self) Caster(make_caster(elevations, azimuths, range_min_m, range_max_m));
           },
           "elevations"_a, "azimuths"_a, "range_min_m"_a, "range_max_m"_a)
      .def("add_shape", &add_shape, "kinds"_a, "centres"_a, "rotations"_a, "halves"_a)
      .def("add_plate", &add_plate, "shape"_a, "down_m"_a, "ring"_a)
      .def("mount", &mount, "own_shape"_a, "p_BS"_a, "R_BS"_a)
      .def("cast", &cast, "p_NS"_a, "R_NS"_a, "shapes"_a, "p_NO"_a, "R_NO"_a, "water_z"_a, "own"_a,
           "beam"_a.noconvert(), "distance"_a.noconvert(), "body"_a.noconvert());
  bind_vessel(m);
}
