// Fuzzes the search for an object's shift: any numbers are strips, a guess and a centre; see run.sh.
#include "shift.hpp"

#include <cstdint>
#include <cstring>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const std::size_t share = data[0];  // of 255: how many of the strips are of the first scan
  std::vector<double> numbers((size - 1) / sizeof(double));
  if (numbers.empty()) return 0;
  std::memcpy(numbers.data(), data + 1, numbers.size() * sizeof(double));
  static constexpr std::size_t ROW = 4;
  const std::size_t rows = numbers.size() / ROW, first = rows * share / 255;
  const std::span<const double> all(numbers.data(), rows * ROW);
  const twinscrew::Pair2 guess{numbers.front(), numbers.back()}, centre{numbers.back(), 0.0};
  static twinscrew::ShiftFinder find({0.5, 0.3, 1.0, 0.02, 0.3, 3.0, 3});
  const auto before = all.first(first * ROW), after = all.subspan(first * ROW);
  const twinscrew::Shift shift = find(before, after, guess, centre, 0.1);
  if (shift.pairs < 0 || static_cast<std::size_t>(shift.pairs) > after.size() / ROW) __builtin_trap();
  return 0;
}
