// Python bindings: check the arguments, release the GIL, call the pure C++ core.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>

#include <stdexcept>

#include "gather.hpp"

namespace nb = nanobind;

namespace {

using Bytes = nb::ndarray<const std::uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Points = nb::ndarray<float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

// A record's last byte, were `height` rows of `width` records laid out so; checks for overflow.
void check(const twinscrew::RecordLayout& layout, std::size_t size, std::size_t points) {
  std::size_t rows = 0, row = 0;
  if (__builtin_mul_overflow(layout.height, layout.row_step, &rows) || rows > size ||
      __builtin_mul_overflow(layout.width, layout.point_step, &row) || row > layout.row_step ||
      layout.height * layout.width != points) {
    throw std::invalid_argument("gather_frd: the records do not fit the data");
  }
  for (const std::size_t offset : layout.offsets) {
    if (layout.point_step < sizeof(float) || offset > layout.point_step - sizeof(float)) {
      throw std::invalid_argument("gather_frd: a field lies outside its record");
    }
  }
}

void gather_frd(Bytes data, std::array<std::size_t, 3> offsets, std::array<std::size_t, 2> shape,
                std::array<std::size_t, 2> steps, Points points_S) {
  const twinscrew::RecordLayout layout{offsets, shape[0], shape[1], steps[0], steps[1]};
  check(layout, data.size(), points_S.shape(0));
  const nb::gil_scoped_release release;
  twinscrew::gather_frd(data.data(), layout, points_S.data());
}

}  // namespace

NB_MODULE(_native, m) {
  m.doc() = "Native kernels.";
  m.def("gather_frd", &gather_frd, nb::arg("data"), nb::arg("offsets"), nb::arg("shape"),
        nb::arg("steps"), nb::arg("points_S").noconvert(),
        "Copy float32 x, y, z records (forward-left-up) into points_S (forward-starboard-down).");
}
