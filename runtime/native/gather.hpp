// Strided records to contiguous points.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace twinscrew {

// Where float32 x, y, z lie in rows of records. The caller has checked that all lie inside.
struct RecordLayout {
  std::array<std::size_t, 3> offsets;  // [bytes] of x, y, z from a record's start
  std::size_t height, width;           // [-] rows, points a row
  std::size_t row_step, point_step;    // [bytes]
};

// Copies forward-left-up records into forward-starboard-down points, (height * width, 3).
inline void gather_frd(const std::uint8_t* data, const RecordLayout& layout, float* points_S) {
  const auto read = [](const std::uint8_t* at) {
    float value;
    std::memcpy(&value, at, sizeof value);  // records need not be aligned
    return value;
  };
  for (std::size_t row = 0; row < layout.height; ++row) {
    const std::uint8_t* record = data + row * layout.row_step;
    for (std::size_t i = 0; i < layout.width; ++i, record += layout.point_step, points_S += 3) {
      points_S[0] = read(record + layout.offsets[0]);
      points_S[1] = -read(record + layout.offsets[1]);
      points_S[2] = -read(record + layout.offsets[2]);
    }
  }
}

}  // namespace twinscrew
