// Python bindings: check the arguments, release the GIL, call the pure C++ core.
#include <nanobind/stl/array.h>

#include "arrays.hpp"
#include "gather.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace twinscrew {
namespace {

using Bytes = Array<const std::uint8_t, -1>;
using OutPoints = Array<float, -1, 3>;

void gather_records(Bytes data, std::array<std::size_t, 3> offsets,
                    std::array<std::size_t, 2> shape, std::array<std::size_t, 2> steps,
                    OutPoints points_S) {
  const RecordLayout layout{offsets, shape[0], shape[1], steps[0], steps[1]};
  require(fits(layout, data.size(), points_S.shape(0)),
          "gather_frd: the records do not fit the data");
  const nb::gil_scoped_release release;
  gather_frd(data.data(), layout, points_S.data());
}

}  // namespace

void bind_kernel(nb::module_& m);     // bind_kernel.cpp
void bind_tracking(nb::module_& m);   // bind_tracking.cpp
void bind_assurance(nb::module_& m);  // bind_assurance.cpp
void bind_joint(nb::module_& m);      // bind_joint.cpp
void bind_charts(nb::module_& m);      // bind_charts.cpp

}  // namespace twinscrew

NB_MODULE(_native, m) {
  m.doc() = "Native kernels.";
  // A failing test's traceback holds objects until the interpreter ends; a list of them would drown
  // the failure.
  nb::set_leak_warnings(false);
  m.def("gather_frd", &twinscrew::gather_records, "data"_a, "offsets"_a, "shape"_a, "steps"_a,
        nb::arg("points_S").noconvert(),
        "Copy float32 x, y, z records (forward-left-up) into points_S (forward-starboard-down).");
  twinscrew::bind_kernel(m);
  twinscrew::bind_tracking(m);
  twinscrew::bind_assurance(m);
  twinscrew::bind_joint(m);
  twinscrew::bind_charts(m);
}
