// Strided records to contiguous points.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace twinscrew {

// Where float32 x, y, z lie in rows of records.
struct RecordLayout {
  std::array<std::size_t, 3> offsets;  // [bytes] of x, y, z from a record's start
  std::size_t height, width;           // [-] rows, points a row
  std::size_t row_step, point_step;    // [bytes]
};

// Does every record lie in the data, and every value in its record? Sure of overflow.
inline bool fits(const RecordLayout& layout, std::size_t size, std::size_t points) {
  std::size_t rows = 0, row = 0, count = 0;
  if (__builtin_mul_overflow(layout.height, layout.row_step, &rows) || rows > size ||
      __builtin_mul_overflow(layout.width, layout.point_step, &row) ||
      (layout.height > 0 && row > layout.row_step) ||
      __builtin_mul_overflow(layout.height, layout.width, &count) || count != points) {
    return false;
  }
  for (const std::size_t offset : layout.offsets) {
    if (layout.point_step < sizeof(float) || offset > layout.point_step - sizeof(float)) {
      return false;
    }
  }
  return true;
}

// Copies forward-left-up records into forward-starboard-down points, (height * width, 3).
inline void gather_frd(const std::uint8_t* data, const RecordLayout& layout, float* points_S) {
  const auto read = [](const std::uint8_t* at) {
    float value;
    std::memcpy(&value, at, sizeof value);  // records need not be aligned
    return value;
  };
  if (layout.width == 0) return;  // any number of empty rows takes no bytes
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
