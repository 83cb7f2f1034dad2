// Fuzzes the check of a cloud's layout and the copy behind it: a layout that passes the check must
// never be read outside its data; see run.sh.
#include "gather.hpp"

#include <cstring>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  twinscrew::RecordLayout layout{};
  std::uint8_t raw[7] = {};
  std::memcpy(raw, data, size < sizeof raw ? size : sizeof raw);
  const bool huge = size > 0 && (data[size - 1] & 1) != 0;  // sizes that overflow when multiplied
  const std::size_t scale = huge ? std::size_t{1} << 58 : 1;
  layout.offsets = {raw[0], raw[1], raw[2]};
  layout.height = raw[3] * scale;
  layout.width = raw[4];
  layout.row_step = raw[5] * (huge ? scale : std::size_t{raw[6]} + 1);
  layout.point_step = raw[6];
  const std::size_t used = size < sizeof raw ? size : sizeof raw;
  const std::vector<std::uint8_t> bytes(data + used, data + size);
  const std::size_t points = layout.height * layout.width;
  if (!twinscrew::fits(layout, bytes.size(), points)) return 0;
  std::vector<float> out(3 * points);
  twinscrew::gather_frd(bytes.data(), layout, out.data());
  return 0;
}
