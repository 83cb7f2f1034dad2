// Python bindings of perception: check the arguments, release the GIL, call the pure C++ core.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

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

std::span<const float> values(const std::optional<Values>& array, std::size_t size) {
  if (!array) return {};
  require(array->size() == size, "Kernel: a value for each point, or none");
  return {array->data(), size};
}

Counts project(Kernel& kernel, Points points_S, std::optional<Values> intensity,
               std::optional<Values> time, const Matrix& R_BS, const Vector& p_BS,
               const Matrix& R_LB, std::optional<Motion> motion) {
  const std::size_t size = points_S.shape(0);
  require(size <= static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()),
          "Kernel: too many points");
  const Cloud cloud{{points_S.data(), 3 * size}, values(intensity, size), values(time, size)};
  const nb::gil_scoped_release release;
  return kernel.project(cloud, {R_BS, p_BS}, R_LB, motion ? &*motion : nullptr);
}

// The objects, (K, 5): x, y, radius, number of echoes, and of what object it is a piece, or -1.
Given<double> objects(Kernel& kernel) {
  const std::vector<Circle>* circles = nullptr;
  {
    const nb::gil_scoped_release release;
    circles = &kernel.objects();
  }
  return make_array<double>({circles->size(), 5}, [&](double* out) {
    for (const Circle& c : *circles) {
      for (const double value : {c.x, c.y, c.radius, static_cast<double>(c.count),
                                 static_cast<double>(c.cut_from)}) {
        *out++ = value;
      }
    }
  });
}

// The outline: (3,) where the sights begin, and (3,) the sensor's z axis, levelled frame B; (A, 2)
// where they end; (A,) heights of their echoes, NaN without; (A,) of which cut object, or -1.
nb::tuple outline(Kernel& kernel) {
  const std::vector<Sight>* found = nullptr;
  {
    const nb::gil_scoped_release release;
    found = &kernel.outline();
  }
  const Transform& X_LS = kernel.X_LS();
  auto begin = make_array<double>({3}, [&](double* out) { std::ranges::copy(X_LS.t, out); });
  auto down = make_array<double>({3}, [&](double* out) {
    for (const std::size_t i : {2, 5, 8}) *out++ = X_LS.R[i];
  });
  auto ends = make_array<double>({found->size(), 2}, [&](double* out) {
    for (const Sight& sight : *found) {
      *out++ = sight.x;
      *out++ = sight.y;
    }
  });
  auto heights = make_array<double>({found->size()}, [&](double* out) {
    for (const Sight& sight : *found) *out++ = sight.height;
  });
  auto seen = make_array<std::int64_t>({found->size()}, [&](std::int64_t* out) {
    for (const Sight& sight : *found) *out++ = sight.seen;
  });
  return nb::make_tuple(begin, down, ends, heights, seen);
}

// The strips of the objects: (K + 1,) the row at which each object's begin, and (S, 4) the rows:
// x, y, length, number of echoes.
nb::tuple strips(Kernel& kernel) {
  const std::vector<Strip>* found = nullptr;
  {
    const nb::gil_scoped_release release;
    found = &kernel.strips();
  }
  const std::size_t circles = kernel.circles();
  auto begins = make_array<std::int64_t>({circles + 1}, [&](std::int64_t* out) {
    std::fill(out, out + circles + 1, 0);
    for (const Strip& s : *found) ++out[s.circle + 1];
    for (std::size_t i = 0; i < circles; ++i) out[i + 1] += out[i];
  });
  auto rows = make_array<double>({found->size(), 4}, [&](double* out) {
    for (const Strip& s : *found) {
      for (const double value : {s.x, s.y, s.length, static_cast<double>(s.count)}) *out++ = value;
    }
  });
  return nb::make_tuple(begins, rows);
}

// An image of what `value(cell)` gives, and of `empty` where there is no echo.
template <class T, class Value>
Given<T> image_of(const Kernel& kernel, T empty, Value value) {
  const RangeImage& image = kernel.image();
  const auto rows = static_cast<std::size_t>(image.rows());
  const auto columns = static_cast<std::size_t>(image.columns());
  return make_array<T>({rows, columns}, [&](T* out) {
    std::fill(out, out + image.size(), empty);
    image.each([&](std::size_t cell) { out[cell] = value(cell); });
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
  nb::class_<Motion>(m, "Motion", "How the vessel moved during the scan.")
      .def(nb::init<Vector, Vector, float, float>(), "rates"_a, "velocity"_a, "first_time"_a,
           "time_per_column"_a);
  nb::class_<Counts>(m, "Counts", "What became of the points.")
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
  nb::class_<Kernel>(m, "Kernel", "Perception on one core, with its memory kept between scans.")
      .def(
          "__init__",
          [](Kernel* self, const std::vector<double>& elevations, double first_azimuth,
             double azimuth_step, int columns, bool wraps, const Gates& gates, double theta,
             double noise, int bridged, float reach, float merge_across, float merge_along,
             const FootprintRule& footprint, int least_points, float longest, float piece,
             float strip_gap, int sector) {
            require(sector > 0, "Kernel: a sector has at least one column");
            const Scanner scanner(elevations, first_azimuth, azimuth_step, columns, wraps);
            const CircleRules rules{least_points,    longest,        piece,
                                    gates.mask_hull, gates.hull_aft, gates.hull_fore};
            new (self) Kernel(scanner, gates, {theta, noise, bridged}, reach,
                              {merge_across, merge_along}, footprint, rules, strip_gap, sector);
          },
          nb::kw_only(), "elevations"_a, "first_azimuth"_a, "azimuth_step"_a, "columns"_a,
          "wraps"_a, "gates"_a, "theta"_a, "noise"_a, "bridged"_a, "reach"_a, "merge_across"_a,
          "merge_along"_a, "footprint"_a, "least_points"_a, "longest"_a, "piece"_a, "strip_gap"_a,
          "sector"_a)
      .def("project", &project, "points_S"_a, "intensity"_a.none(), "time"_a.none(), "R_BS"_a,
           "p_BS"_a, "R_LB"_a, "motion"_a.none())
      .def("segment", &Kernel::segment, nb::call_guard<nb::gil_scoped_release>())
      .def("objects", &objects)
      .def("strips", &strips)
      .def("outline", &outline)
      .def("range_image",
           [](const Kernel& k) {
             return image_of<float>(k, 0.0F, [&](std::size_t c) { return k.image().range(c); });
           })
      .def("point_image",
           [](const Kernel& k) {
             return image_of<std::int32_t>(k, -1,
                                           [&](std::size_t c) { return k.image().echo(c).point; });
           })
      .def("labels",
           [](const Kernel& k) {
             return image_of<std::int32_t>(k, -1, [&](std::size_t c) { return k.labels()[c]; });
           })
      .def("object_image", [](const Kernel& k) {
        return image_of<std::int32_t>(k, -1, [&](std::size_t c) { return k.circle_of(c); });
      });
}

}  // namespace twinscrew
