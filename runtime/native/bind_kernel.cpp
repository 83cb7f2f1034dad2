// Python bindings of perception: check the arguments, release the GIL, call the pure C++ core.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "arrays.hpp"
#include "kernel.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace twinscrew {
namespace {

using Points = Array<const float, -1, 3>;
using Values = Array<const float, -1>;

using Vector3 = In<3>;

// A kernel for the sensor in its place, and when the sensor's columns are fired.
struct MountedKernel : Kernel {
  template <class... Arguments>
  MountedKernel(const Transform& place, std::optional<std::array<float, 2>> column_times,
                Arguments&&... arguments)
      : Kernel(std::forward<Arguments>(arguments)...), X_BS(place), times(column_times) {}

  Transform X_BS;
  std::optional<std::array<float, 2>> times;  // [s] of the first column, between two; or at once
};

std::span<const float> values(const std::optional<Values>& array, std::size_t size) {
  if (!array) return {};
  require(array->size() == size, "perception: a value for each point, or none");
  return {array->data(), size};
}

void require_finite(const double* begin, std::size_t size, const char* message) {
  require(std::all_of(begin, begin + size, [](double v) { return std::isfinite(v); }), message);
}

// R_LB, which levels: R_y(pitch) R_x(roll). Fossen (2021), eq. 2.31 without heading.
Matrix levelling(const In<4>& q_NB) {
  const double w = q_NB(0), x = q_NB(1), y = q_NB(2), z = q_NB(3);
  const double roll = std::atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y));
  const double pitch = std::asin(std::clamp(2 * (w * y - z * x), -1.0, 1.0));
  const double cr = std::cos(roll), sr = std::sin(roll), cp = std::cos(pitch), sp = std::sin(pitch);
  const std::array<double, 9> R{cp, sp * sr, sp * cr, 0.0, cr, -sr, -sp, cp * sr, cp * cr};
  Matrix result{};
  std::ranges::transform(R, result.begin(), [](double v) { return static_cast<float>(v); });
  return result;
}

// The vessel's motion, of what is given; none for a scan that was taken at once.
std::optional<Motion> motion_of(const MountedKernel& kernel, const std::optional<Vector3>& rates,
                                const std::optional<Vector3>& velocity) {
  if (rates) require_finite(rates->data(), 3, "perception: the vessel's rates are not finite");
  if (velocity) {
    require_finite(velocity->data(), 3, "perception: the vessel's velocity is not finite");
  }
  if (!kernel.times || !(rates || velocity)) return std::nullopt;
  Motion motion{{}, {}, (*kernel.times)[0], (*kernel.times)[1]};
  for (std::size_t i = 0; i < 3; ++i) {
    motion.rates[i] = rates ? static_cast<float>((*rates)(i)) : 0.0F;
    motion.velocity[i] = velocity ? static_cast<float>((*velocity)(i)) : 0.0F;
  }
  return motion;
}

// A scan's arguments, checked.
struct Scan {
  Cloud cloud;
  Matrix R_LB;
  std::optional<Motion> motion;

  Scan(const MountedKernel& kernel, const Points& points_S, const std::optional<Values>& intensity,
       const std::optional<Values>& time, const In<4>& q_NB, const std::optional<Vector3>& rates,
       const std::optional<Vector3>& velocity) {
    const std::size_t size = points_S.shape(0);
    require(size <= static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()),
            "perception: too many points");
    require_finite(q_NB.data(), 4, "perception: the vessel's attitude is not finite");
    cloud = {{points_S.data(), 3 * size}, values(intensity, size), values(time, size)};
    R_LB = levelling(q_NB);
    motion = motion_of(kernel, rates, velocity);
  }
};

Counts project(MountedKernel& kernel, const Scan& scan) {
  return kernel.project(scan.cloud, kernel.X_BS, scan.R_LB, scan.motion ? &*scan.motion : nullptr);
}

template <class T, class Row, class Value>
Given<T> column_of(const std::vector<Row>& rows, Value value) {
  return make_array<T>({rows.size()}, [&](T* out) {
    for (const Row& row : rows) *out++ = static_cast<T>(value(row));
  });
}

// What the image's components are; see the stub for what the arrays are. L: frame B, levelled.
nb::tuple objects(MountedKernel& kernel) {
  const std::vector<Circle>* circles = nullptr;
  const std::vector<Strip>* strips = nullptr;
  const std::vector<BoundaryPoint>* outline = nullptr;
  {
    const nb::gil_scoped_release release;
    circles = &kernel.objects();
    strips = &kernel.strips();
    outline = &kernel.outline();
  }
  auto centres = make_array<double>({circles->size(), 2}, [&](double* out) {
    for (const Circle& c : *circles) *out++ = c.x, *out++ = c.y;
  });
  auto begins = make_array<std::int64_t>({circles->size() + 1}, [&](std::int64_t* out) {
    std::fill(out, out + circles->size() + 1, 0);
    for (const Strip& s : *strips) ++out[s.circle + 1];
    for (std::size_t i = 0; i < circles->size(); ++i) out[i + 1] += out[i];
  });
  auto rows = make_array<double>({strips->size(), 4}, [&](double* out) {
    for (const Strip& s : *strips) {
      *out++ = s.x, *out++ = s.y, *out++ = s.length, *out++ = static_cast<double>(s.count);
    }
  });
  auto boundary = make_array<double>({outline->size(), 2}, [&](double* out) {
    for (const BoundaryPoint& point : *outline) *out++ = point.x, *out++ = point.y;
  });
  const Transform& X_LS = kernel.X_LS();
  auto origin = make_array<double>({3}, [&](double* out) { std::ranges::copy(X_LS.t, out); });
  auto down = make_array<double>({3}, [&](double* out) {
    for (const std::size_t i : {2, 5, 8}) *out++ = X_LS.R[i];
  });
  return nb::make_tuple(
      centres, column_of<double>(*circles, [](const Circle& c) { return c.radius; }),
      column_of<std::int64_t>(*circles, [](const Circle& c) { return c.count; }),
      column_of<std::int64_t>(*circles, [](const Circle& c) { return c.cut_from; }), begins, rows,
      origin, down, boundary,
      column_of<double>(*outline, [](const BoundaryPoint& p) { return p.height; }),
      column_of<std::int64_t>(*outline, [](const BoundaryPoint& p) { return p.seen; }));
}

// An image of what `value(cell)` gives, and of `empty` where there is no echo.
template <class T, class Value>
Given<T> image_of(const Kernel& kernel, T empty, Value value) {
  const RangeImage& image = kernel.image();
  const auto rows = static_cast<std::size_t>(image.rows());
  const auto columns = static_cast<std::size_t>(image.columns());
  return make_array<T>({rows, columns}, [&](T* out) {
    std::fill(out, out + rows * columns, empty);
    for (int row = 0; row < image.rows(); ++row, out += columns) {
      image.each_in_row(row, [&](int column, std::size_t cell) { out[column] = value(cell); });
    }
  });
}

}  // namespace

void bind_kernel(nb::module_& m) {
  nb::class_<Gates>(m, "Gates", "Which echoes are of use.")
      .def(nb::init<>())
      .def_rw("range_min", &Gates::range_min)
      .def_rw("range_max", &Gates::range_max)
      .def_rw("mask_hull", &Gates::mask_hull)
      .def_rw("hull_aft", &Gates::hull_aft)
      .def_rw("hull_fore", &Gates::hull_fore)
      .def_rw("hull_half_width", &Gates::hull_half_width)
      .def_rw("drop_water", &Gates::drop_water)
      .def_rw("surface_down", &Gates::surface_down)
      .def_rw("clearance", &Gates::clearance)
      .def_rw("weak_clearance", &Gates::weak_clearance)
      .def_rw("weak", &Gates::weak);
  nb::class_<Counts>(m, "Counts", "What became of the points.")
      .def(nb::init<>())
      .def_ro("points", &Counts::points)
      .def_ro("empty", &Counts::empty)
      .def_ro("range", &Counts::range)
      .def_ro("no_beam", &Counts::no_beam)
      .def_ro("hull", &Counts::hull)
      .def_ro("water", &Counts::water)
      .def_ro("hidden", &Counts::hidden)
      .def_ro("used", &Counts::used);
  nb::class_<FootprintRule>(m, "FootprintRule", "What may be put together.")
      .def(nb::init<float, float, float, float, int>(), "length"_a, "beam"_a, "reach"_a, "least"_a,
           "points"_a);
  nb::class_<MountedKernel>(m, "Kernel", "Perception on one core, with its memory kept between scans.")
      .def(
          "__init__",
          [](MountedKernel* self, const std::vector<double>& elevations, double first_azimuth,
             double azimuth_step, int columns, bool wraps, const Gates& gates, double theta,
             double noise, int bridged, float reach, float merge_across, float merge_along,
             const FootprintRule& footprint, int least_points, float full_range,
             int far_points, float longest, float piece,
             float strip_gap, int sector, const Matrix& R_BS, const Vector& p_BS,
             std::optional<std::array<float, 2>> column_times, bool wide) {
            require(sector > 0, "Kernel: a sector has at least one column");
            const Scanner scanner(elevations, first_azimuth, azimuth_step, columns, wraps);
            const CircleRules rules{least_points,   full_range, far_points, longest,
                                    piece,          gates.mask_hull,
                                    gates.hull_aft, gates.hull_fore};
            new (self) MountedKernel(
                Transform{R_BS, p_BS}, column_times, scanner, gates,
                Criterion{theta, noise, bridged}, reach, MergeRule{merge_across, merge_along},
                footprint, rules, strip_gap, sector, wide && has_eight_lanes());
          },
          nb::kw_only(), "elevations"_a, "first_azimuth"_a, "azimuth_step"_a, "columns"_a,
          "wraps"_a, "gates"_a, "theta"_a, "noise"_a, "bridged"_a, "reach"_a, "merge_across"_a,
          "merge_along"_a, "footprint"_a, "least_points"_a, "full_range"_a,
          "far_points"_a, "longest"_a, "piece"_a, "strip_gap"_a,
          "sector"_a, "R_BS"_a, "p_BS"_a, "column_times"_a.none(), "wide"_a = true)
      .def(
          "scan",
          [](MountedKernel& kernel, const Points& points_S, const std::optional<Values>& intensity,
             const std::optional<Values>& time, const In<4>& q_NB,
             const std::optional<Vector3>& rates, const std::optional<Vector3>& velocity) {
            const Scan scan(kernel, points_S, intensity, time, q_NB, rates, velocity);
            Counts counts;
            {
              const nb::gil_scoped_release release;
              counts = project(kernel, scan);
              kernel.segment();
            }
            return nb::make_tuple(counts, objects(kernel));
          },
          "points_S"_a, "intensity"_a.none(), "time"_a.none(), "q_NB"_a, "rates"_a.none(),
          "velocity"_a.none())
      .def(
          "project",
          [](MountedKernel& kernel, const Points& points_S, const std::optional<Values>& intensity,
             const std::optional<Values>& time, const In<4>& q_NB,
             const std::optional<Vector3>& rates, const std::optional<Vector3>& velocity) {
            const Scan scan(kernel, points_S, intensity, time, q_NB, rates, velocity);
            const nb::gil_scoped_release release;
            return project(kernel, scan);
          },
          "points_S"_a, "intensity"_a.none(), "time"_a.none(), "q_NB"_a, "rates"_a.none(),
          "velocity"_a.none())
      .def("segment", &MountedKernel::segment, nb::call_guard<nb::gil_scoped_release>())
      .def("objects", &objects)
      .def("range_image",
           [](const MountedKernel& k) {
             return image_of<float>(k, 0.0F, [&](std::size_t c) { return k.image().range(c); });
           })
      .def("point_image",
           [](const MountedKernel& k) {
             return image_of<std::int32_t>(k, -1,
                                           [&](std::size_t c) { return k.image().echo(c).point; });
           })
      .def("labels",
           [](const MountedKernel& k) {
             return image_of<std::int32_t>(k, -1, [&](std::size_t c) { return k.label(c); });
           })
      .def("object_image", [](const MountedKernel& k) {
        return image_of<std::int32_t>(k, -1, [&](std::size_t c) { return k.circle_of(c); });
      });
}

}  // namespace twinscrew
