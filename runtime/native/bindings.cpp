// Python bindings: check the arguments, release the GIL, call the pure C++ core.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <stdexcept>
#include <type_traits>

#include "assurance.hpp"
#include "centroids.hpp"
#include "gather.hpp"
#include "kernel.hpp"
#include "shift.hpp"
#include "small.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Bytes = nb::ndarray<const std::uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using OutPoints = nb::ndarray<float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Points = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using twinscrew::Kernel;

void gather_frd(Bytes data, std::array<std::size_t, 3> offsets, std::array<std::size_t, 2> shape,
                std::array<std::size_t, 2> steps, OutPoints points_S) {
  const twinscrew::RecordLayout layout{offsets, shape[0], shape[1], steps[0], steps[1]};
  if (!twinscrew::fits(layout, data.size(), points_S.shape(0))) {
    throw std::invalid_argument("gather_frd: the records do not fit the data");
  }
  const nb::gil_scoped_release release;
  twinscrew::gather_frd(data.data(), layout, points_S.data());
}

std::span<const float> values(const std::optional<Values>& array, std::size_t size) {
  if (!array) return {};
  if (array->size() != size) throw std::invalid_argument("Kernel: a value for each point, or none");
  return {array->data(), size};
}

twinscrew::Counts project(Kernel& kernel, Points points_S, std::optional<Values> intensity,
                          std::optional<Values> time, const twinscrew::Matrix& R_BS,
                          const twinscrew::Vector& p_BS, const twinscrew::Matrix& R_LB,
                          std::optional<twinscrew::Motion> motion) {
  const std::size_t size = points_S.shape(0);
  if (size > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) {
    throw std::invalid_argument("Kernel: too many points");
  }
  const twinscrew::Cloud cloud{{points_S.data(), 3 * size}, values(intensity, size),
                               values(time, size)};
  const nb::gil_scoped_release release;
  return kernel.project(cloud, {R_BS, p_BS}, R_LB, motion ? &*motion : nullptr);
}

// An array of its own memory, filled by `fill(pointer)`.
template <class T, class Fill>
nb::ndarray<nb::numpy, T> make_array(std::initializer_list<std::size_t> shape, Fill fill) {
  std::size_t size = 1;
  for (const std::size_t n : shape) size *= n;
  auto memory = std::make_unique<T[]>(std::max<std::size_t>(size, 1));
  fill(memory.get());
  T* raw = memory.release();
  const nb::capsule owner(raw, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  return nb::ndarray<nb::numpy, T>(raw, shape, owner);
}

// The objects, (K, 4): x, y, radius, number of echoes.
nb::ndarray<nb::numpy, double> objects(Kernel& kernel) {
  const std::vector<twinscrew::Circle>* circles = nullptr;
  {
    const nb::gil_scoped_release release;
    circles = &kernel.objects();
  }
  return make_array<double>({circles->size(), 4}, [&](double* out) {
    for (const twinscrew::Circle& c : *circles) {
      for (const double value : {c.x, c.y, c.radius, static_cast<double>(c.count)}) *out++ = value;
    }
  });
}

// The strips of the objects: (K + 1,) the row at which each object's begin, and (S, 4) the rows:
// x, y, length, number of echoes.
nb::tuple strips(Kernel& kernel) {
  const std::vector<twinscrew::Strip>* found = nullptr;
  {
    const nb::gil_scoped_release release;
    found = &kernel.strips();
  }
  const std::size_t circles = kernel.circles();
  auto begins = make_array<std::int64_t>({circles + 1}, [&](std::int64_t* out) {
    std::fill(out, out + circles + 1, 0);
    for (const twinscrew::Strip& s : *found) ++out[s.circle + 1];
    for (std::size_t i = 0; i < circles; ++i) out[i + 1] += out[i];
  });
  auto rows = make_array<double>({found->size(), 4}, [&](double* out) {
    for (const twinscrew::Strip& s : *found) {
      for (const double value : {s.x, s.y, s.length, static_cast<double>(s.count)}) *out++ = value;
    }
  });
  return nb::make_tuple(begins, rows);
}

using StripRows = nb::ndarray<const double, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;

twinscrew::Shift find_shift(twinscrew::ShiftFinder& finder, StripRows before, StripRows after,
                            const twinscrew::Pair2& guess, const twinscrew::Pair2& centre,
                            double turn) {
  if (!(turn > 0.0)) throw std::invalid_argument("ShiftFinder: turn must be positive");
  return finder({before.data(), before.size()}, {after.data(), after.size()}, guess, centre, turn);
}

// An image of what `value(cell)` gives, and of `empty` where there is no echo.
template <class T, class Value>
nb::ndarray<nb::numpy, T> image_of(const Kernel& kernel, T empty, Value value) {
  const twinscrew::RangeImage& image = kernel.image();
  const auto rows = static_cast<std::size_t>(image.rows());
  const auto columns = static_cast<std::size_t>(image.columns());
  return make_array<T>({rows, columns}, [&](T* out) {
    std::fill(out, out + image.size(), empty);
    image.each([&](std::size_t cell) { out[cell] = value(cell); });
  });
}

void bind_shift(nb::module_& m) {
  using twinscrew::Shift;
  nb::class_<Shift>(m, "Shift", "How far an object has moved.")
      .def_ro("pairs", &Shift::pairs)
      .def_ro("x", &Shift::x)
      .def_ro("y", &Shift::y)
      .def_ro("xx", &Shift::xx)
      .def_ro("xy", &Shift::xy)
      .def_ro("yy", &Shift::yy);
  nb::class_<twinscrew::ShiftFinder>(m, "ShiftFinder", "Finds strips again in the next scan.")
      .def(
          "__init__",
          [](twinscrew::ShiftFinder* self, double search, double length, double spacing,
             double sigma, double ends, double robust, int pairs) {
            new (self) twinscrew::ShiftFinder(
                {search, length, spacing, sigma, ends, robust, std::max(pairs, 1)});
          },
          nb::kw_only(), "search"_a, "length"_a, "spacing"_a, "sigma"_a, "ends"_a, "robust"_a,
          "pairs"_a)
      .def("__call__", &find_shift, "before"_a, "after"_a, "guess"_a, "centre"_a, "turn"_a);
}

using Rows2 = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using Column = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Path = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

twinscrew::Surroundings surroundings(const Rows2& p, const Rows2& v, const Column& radius,
                                     const Column& horizon) {
  const std::size_t size = radius.size();
  if (p.shape(0) != size || v.shape(0) != size || horizon.size() != size) {
    throw std::invalid_argument("Foresight: p, v, radius and horizon of every circle");
  }
  return {{p.data(), 2 * size}, {v.data(), 2 * size}, {radius.data(), size}, {horizon.data(), size}};
}

nb::tuple as_tuple(const twinscrew::Contact& c) {
  return nb::make_tuple(c.harm, c.time, c.speed, c.circle, c.to_starboard);
}

using Matrix2 = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Matrices = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

nb::ndarray<nb::numpy, double> invert_stack(Matrices matrices) {
  const std::size_t count = matrices.shape(0), n = matrices.shape(1);
  if (matrices.shape(2) != n || n < 1 || n > 8) {
    throw std::invalid_argument("invert_stack: square matrices of at most 8 rows");
  }
  return make_array<double>({count, n, n}, [&](double* out) {
    for (std::size_t i = 0; i < count * n * n; i += n * n) {
      twinscrew::invert_symmetric(matrices.data() + i, out + i, n, n);
    }
  });
}

using States = nb::ndarray<const double, nb::shape<-1, 6>, nb::c_contig, nb::device::cpu>;
using Spreads = nb::ndarray<const double, nb::shape<-1, 6, 6>, nb::c_contig, nb::device::cpu>;
using Looks = nb::ndarray<const double, nb::shape<-1, 2, 6>, nb::c_contig, nb::device::cpu>;
using Noises = nb::ndarray<const double, nb::shape<-1, 2, 2>, nb::c_contig, nb::device::cpu>;

// (3, K, M): squared distances without and with the gate's allowance, log |S| with it.
nb::ndarray<nb::numpy, double> innovations(States x, Spreads P, Rows2 z, Looks H, Noises R,
                                           Column gate) {
  const std::size_t tracks = x.shape(0), seen = z.shape(0);
  if (P.shape(0) != tracks || H.shape(0) != seen || R.shape(0) != seen || gate.size() != seen) {
    throw std::invalid_argument("innovations: x, P of each track, z, H, R, gate of each object");
  }
  const twinscrew::Predicted predicted{{x.data(), x.size()}, {P.data(), P.size()}};
  const twinscrew::Measured measured{
      {z.data(), z.size()}, {H.data(), H.size()}, {R.data(), R.size()}, {gate.data(), seen}};
  return make_array<double>({3, tracks, seen}, [&](double* out) {
    for (std::size_t k = 0; k < tracks; ++k) {
      for (std::size_t m = 0; m < seen; ++m, ++out) {
        const twinscrew::Innovation found = twinscrew::innovation(predicted, measured, k, m);
        out[0] = found.strict2;
        out[tracks * seen] = found.distance2;
        out[2 * tracks * seen] = found.log_det;
      }
    }
  });
}

using Numbers = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// One column of what was measured, an array of its own.
template <class Pick>
nb::ndarray<nb::numpy, double> column_of(const std::vector<twinscrew::CentroidRow>& rows,
                                         std::initializer_list<std::size_t> shape, Pick pick) {
  return make_array<double>(shape, [&](double* out) {
    for (const twinscrew::CentroidRow& row : rows) {
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
nb::tuple measured(const twinscrew::CentroidModel& model, Rows2 p, Column radius, Numbers points,
                   const std::array<double, 4>& stand) {
  const std::size_t size = p.shape(0);
  if (radius.size() != size || points.size() != size) {
    throw std::invalid_argument("CentroidModel: place, radius and points of each object");
  }
  const twinscrew::Stand own{stand[0], stand[1], stand[2], stand[3]};
  std::vector<twinscrew::CentroidRow> rows;
  nb::list kept;
  rows.reserve(size);
  for (std::size_t k = 0; k < size && own.finite(); ++k) {
    const double x = p.data()[2 * k], y = p.data()[2 * k + 1], r = radius.data()[k];
    if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(r)) continue;
    rows.push_back(model.row(x, y, r, points.data()[k], own));
    kept.append(k);
  }
  using twinscrew::CentroidRow;
  const std::size_t n = rows.size();
  return nb::make_tuple(column_of(rows, {n, 2}, &CentroidRow::z),
                        column_of(rows, {n, 2, 6}, &CentroidRow::H),
                        column_of(rows, {n, 2, 2}, &CentroidRow::R),
                        column_of(rows, {n}, &CentroidRow::radius),
                        column_of(rows, {n}, &CentroidRow::gate), kept);
}

// (K, 2) how far centroids of things may be off: a row begins with north and east [m]. Seen from
// nowhere, they are taken to be near.
nb::ndarray<nb::numpy, double> bias_variance(const twinscrew::CentroidModel& model, Matrix2 places,
                                             Column radius, double north, double east) {
  const std::size_t size = places.shape(0), width = places.shape(1);
  if (radius.size() != size || width < 2) {
    throw std::invalid_argument("CentroidModel: place and radius of each thing");
  }
  return make_array<double>({size, 2}, [&](double* out) {
    for (std::size_t k = 0; k < size; ++k) {
      const double* p = places.data() + width * k;
      const double distance = std::hypot(p[0] - north, p[1] - east);
      const auto both =
          model.variance(std::isfinite(distance) ? distance : 0.0, radius.data()[k]);
      out = std::copy(both.begin(), both.end(), out);
    }
  });
}

void bind_tracking(nb::module_& m) {
  nb::class_<twinscrew::CentroidModel>(m, "CentroidModel", "What visible centroids say.")
      .def(
          "__init__",
          [](twinscrew::CentroidModel* self, const std::vector<double>& range,
             const std::vector<double>& depth, double small_depth, double buoy, double hull,
             double along, double across, double row_spread, double row, double sigma,
             double scatter, double jump, double edge, double edge_sigma) {
            if (range.empty() || range.size() != depth.size() || !(buoy < hull)) {
              throw std::invalid_argument("CentroidModel: a depth for each range, and radii that rise");
            }
            new (self) twinscrew::CentroidModel({range, depth, small_depth, buoy, hull, along,
                                                 across, row_spread, row, sigma, scatter, jump,
                                                 edge, edge_sigma});
          },
          nb::kw_only(), "range"_a, "depth"_a, "small_depth"_a, "buoy"_a, "hull"_a, "along"_a,
          "across"_a, "row_spread"_a, "row"_a, "sigma"_a, "scatter"_a, "jump"_a, "edge"_a,
          "edge_sigma"_a)
      .def("measured", &measured, "p"_a, "radius"_a, "points"_a, "stand"_a)
      .def("bias_variance", &bias_variance, "places"_a, "radius"_a, "north"_a, "east"_a);
  m.def("invert_stack", &invert_stack, "matrices"_a,
        "Invert symmetric positive definite matrices, (K, n, n), n at most 8.");
  m.def("innovations", &innovations, "x"_a, "P"_a, "z"_a, "H"_a, "R"_a, "gate"_a,
        "How far each measurement is from what each track expects.");
}

void bind_assurance(nb::module_& m) {
  using twinscrew::Foresight, twinscrew::Law, twinscrew::Planar, twinscrew::Thrusts;
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
             const std::vector<Thrusts>& hull, int steps, double dt, double slew, double margin,
             double approach) {
            if (steps < 1 || !(dt > 0.0) || hull.empty()) {
              throw std::invalid_argument("Foresight: a step, a time and a hull at least");
            }
            std::vector<twinscrew::HullCircle> circles;
            for (const auto& [ahead, radius] : hull) circles.push_back({ahead, radius});
            new (self) Foresight({vessel[0], vessel[1], vessel[2], lever}, circles,
                                 {steps, dt, slew, margin, approach});
          },
          nb::kw_only(), "vessel"_a, "lever"_a, "hull"_a, "steps"_a, "dt"_a, "slew"_a, "margin"_a,
          "approach"_a)
      .def(
          "path",
          [](Foresight& self, const Planar& motion, const Thrusts& thrust, const Law& law) {
            const auto path = self.sail(motion, thrust, law);
            return make_array<double>({path.size(), 3}, [&](double* out) {
              for (const Planar& pose : path) out = std::copy(pose.begin(), pose.end(), out);
            });
          },
          "motion"_a, "thrust"_a, "law"_a)
      .def(
          "contact",
          [](const Foresight& self, Path path, Rows2 p, Rows2 v, Column radius, Column horizon) {
            std::vector<Planar> poses(path.shape(0));
            for (std::size_t i = 0; i < 3 * poses.size(); ++i) poses[i / 3][i % 3] = path.data()[i];
            return as_tuple(self.judge(poses, surroundings(p, v, radius, horizon)));
          },
          "path"_a, "p"_a, "v"_a, "radius"_a, "horizon"_a)
      .def(
          "judge",
          [](Foresight& self, const Planar& motion, const Thrusts& thrust, const Law& law, Rows2 p,
             Rows2 v, Column radius, Column horizon) {
            const twinscrew::Surroundings around = surroundings(p, v, radius, horizon);
            return as_tuple(self.judge(self.sail(motion, thrust, law), around));
          },
          "motion"_a, "thrust"_a, "law"_a, "p"_a, "v"_a, "radius"_a, "horizon"_a);
}

void bind_kernel(nb::module_& m) {
  nb::class_<twinscrew::Gates>(m, "Gates", "Which echoes are of use.")
      .def(nb::init<>())
      .def_rw("range_min", &twinscrew::Gates::range_min)
      .def_rw("range_max", &twinscrew::Gates::range_max)
      .def_rw("mask_hull", &twinscrew::Gates::mask_hull)
      .def_rw("hull_aft", &twinscrew::Gates::hull_aft)
      .def_rw("hull_fore", &twinscrew::Gates::hull_fore)
      .def_rw("hull_half_width", &twinscrew::Gates::hull_half_width)
      .def_rw("drop_water", &twinscrew::Gates::drop_water)
      .def_rw("surface_down", &twinscrew::Gates::surface_down)
      .def_rw("clearance", &twinscrew::Gates::clearance)
      .def_rw("weak_clearance", &twinscrew::Gates::weak_clearance)
      .def_rw("weak", &twinscrew::Gates::weak);
  nb::class_<twinscrew::Motion>(m, "Motion", "How the vessel moved during the scan.")
      .def(nb::init<twinscrew::Vector, twinscrew::Vector, float, float>(), "rates"_a, "velocity"_a,
           "first_time"_a, "time_per_column"_a);
  nb::class_<twinscrew::Counts>(m, "Counts", "What became of the points.")
      .def_ro("points", &twinscrew::Counts::points)
      .def_ro("empty", &twinscrew::Counts::empty)
      .def_ro("range", &twinscrew::Counts::range)
      .def_ro("no_beam", &twinscrew::Counts::no_beam)
      .def_ro("hull", &twinscrew::Counts::hull)
      .def_ro("water", &twinscrew::Counts::water)
      .def_ro("hidden", &twinscrew::Counts::hidden)
      .def_ro("used", &twinscrew::Counts::used);
  nb::class_<twinscrew::FootprintRule>(m, "FootprintRule", "What may be put together.")
      .def(nb::init<float, float, float, float, int>(), "length"_a, "beam"_a, "reach"_a, "least"_a,
           "points"_a);
  nb::class_<Kernel>(m, "Kernel", "Perception on one core, with its memory kept between scans.")
      .def(
          "__init__",
          [](Kernel* self, const std::vector<double>& elevations, double first_azimuth,
             double azimuth_step, int columns, bool wraps, const twinscrew::Gates& gates,
             double theta, double noise, int bridged, float reach, float merge_across,
             float merge_along, const twinscrew::FootprintRule& footprint, int least_points,
             float longest, float piece, float strip_gap) {
            const twinscrew::Scanner scanner(elevations, first_azimuth, azimuth_step, columns,
                                             wraps);
            const twinscrew::CircleRules rules{least_points,   longest,        piece,
                                               gates.mask_hull, gates.hull_aft, gates.hull_fore};
            new (self) Kernel(scanner, gates, {theta, noise, bridged}, reach,
                              {merge_across, merge_along}, footprint, rules, strip_gap);
          },
          nb::kw_only(), "elevations"_a, "first_azimuth"_a, "azimuth_step"_a, "columns"_a,
          "wraps"_a, "gates"_a, "theta"_a, "noise"_a, "bridged"_a, "reach"_a, "merge_across"_a,
          "merge_along"_a, "footprint"_a, "least_points"_a, "longest"_a, "piece"_a, "strip_gap"_a)
      .def("project", &project, "points_S"_a, "intensity"_a.none(), "time"_a.none(), "R_BS"_a,
           "p_BS"_a, "R_LB"_a, "motion"_a.none())
      .def("segment", &Kernel::segment, nb::call_guard<nb::gil_scoped_release>())
      .def("objects", &objects)
      .def("strips", &strips)
      .def("range_image",
           [](const Kernel& k) {
             return image_of<float>(k, 0.0F, [&](std::size_t c) { return k.image().range(c); });
           })
      .def("point_image",
           [](const Kernel& k) {
             return image_of<std::int32_t>(
                 k, -1, [&](std::size_t c) { return k.image().echo(c).point; });
           })
      .def("labels",
           [](const Kernel& k) {
             return image_of<std::int32_t>(k, -1, [&](std::size_t c) { return k.labels()[c]; });
           })
      .def("object_image", [](const Kernel& k) {
        return image_of<std::int32_t>(k, -1, [&](std::size_t c) { return k.circle_of(c); });
      });
}

}  // namespace

NB_MODULE(_native, m) {
  m.doc() = "Native kernels.";
  m.def("gather_frd", &gather_frd, "data"_a, "offsets"_a, "shape"_a, "steps"_a,
        nb::arg("points_S").noconvert(),
        "Copy float32 x, y, z records (forward-left-up) into points_S (forward-starboard-down).");
  bind_kernel(m);
  bind_shift(m);
  bind_assurance(m);
  bind_tracking(m);
}
