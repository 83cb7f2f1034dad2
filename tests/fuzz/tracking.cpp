// Fuzzes what the tracker asks of native code: any numbers are objects, tracks and their noise; see
// run.sh.
#include "centroids.hpp"
#include "free_water.hpp"
#include "input.hpp"
#include "small.hpp"

using namespace twinscrew;

namespace {

// The rows of the table are in order, and what was seen is finite: the binding sees to both.
void centroids(Input& input) {
  static const CentroidModel model({{7.2, 10.0, 16.5, 19.5}, {0.02, 0.48, 0.45, 1.0}, 0.32, 0.7, 1.5,
                                    0.05, 0.06, 0.75, 0.0234, 0.01, 0.4, 0.3, 17.0, 0.3});
  const auto own = input.take<Viewpoint>();
  const auto x = input.take<double>(), y = input.take<double>(), radius = input.take<double>();
  const auto points = input.take<std::int64_t>();
  if (!own.finite() || !std::isfinite(x + y) || !std::isfinite(radius)) return;
  const CentroidRow row = model.row(x, y, radius, points, own);
  if (row.R[0] < 0.0 || row.R[0] != row.R[3] || row.gate < 0.0) __builtin_trap();
  const auto [along, across] = model.variance(std::hypot(x, y), radius);
  if (along < 0.0 || across < 0.0) __builtin_trap();
}

// L D L^T of a diagonally dominant matrix is its inverse; of any other, whatever it is, stays
// within its memory.
void inverse(Input& input, bool dominant) {
  static constexpr std::size_t N = 4;
  std::array<double, N * N> matrix = input.take<std::array<double, N * N>>(), inverse{};
  for (std::size_t i = 0; dominant && i < N; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      const double small = std::fmod(matrix[i * N + j], 1.0);
      matrix[i * N + j] = matrix[j * N + i] = i == j ? 4.0 : (std::isfinite(small) ? small : 0.0);
    }
  }
  invert_symmetric(matrix.data(), inverse.data(), N, N);
  for (std::size_t i = 0; dominant && i < N; ++i) {
    for (std::size_t j = 0; j < N; ++j) {
      double sum = 0.0;
      for (std::size_t k = 0; k < N; ++k) sum += matrix[i * N + k] * inverse[k * N + j];
      if (!(std::fabs(sum - (i == j ? 1.0 : 0.0)) < 1e-12)) __builtin_trap();
    }
  }
}

// Every pair's numbers are read within the arrays, whatever they are.
double innovations(Input& input) {
  static constexpr std::size_t TRACK = 6 + 36, SEEN = 2 + 12 + 4 + 1;
  const std::size_t tracks = 1 + input.take<std::uint8_t>() % 3;
  const std::vector<double> numbers = input.rest<double>();
  if (numbers.size() < tracks * TRACK + SEEN) return 0.0;
  const std::size_t seen = (numbers.size() - tracks * TRACK) / SEEN;
  const auto part = [&](std::size_t& from, std::size_t count) {
    from += count;
    return std::vector<double>(numbers.begin() + static_cast<std::ptrdiff_t>(from - count),
                               numbers.begin() + static_cast<std::ptrdiff_t>(from));
  };
  std::size_t at = 0;
  const auto x = part(at, 6 * tracks), P = part(at, 36 * tracks), z = part(at, 2 * seen),
             H = part(at, 12 * seen), R = part(at, 4 * seen), gate = part(at, seen);
  double sum = 0.0;
  for (std::size_t k = 0; k < tracks; ++k) {
    for (std::size_t m = 0; m < seen; ++m) sum += innovation({x, P}, {z, H, R, gate}, k, m, 1e9).distance2;
  }
  return sum;
}

// Whatever the sights, a place that is free is asked for by a number that is one, and taken by whom
// was seen.
void free_water(Input& input) {
  const auto closed = input.take<std::uint8_t>();
  const auto begin = input.take<std::array<double, 2>>();
  const auto widths = input.take<std::array<std::uint8_t, 2>>();
  const auto place = input.take<std::array<double, 4>>();
  Beams beams{{}, input.take<std::array<double, 3>>(), input.take<double>(), input.take<double>()};
  if (closed & 2) beams.sines = {-0.2, -0.1, 0.0, 0.1};
  if (!std::isfinite(begin[0]) || !std::isfinite(begin[1])) return;  // the binding sees to it
  std::vector<BoundaryEnd> sights;
  for (const double number : input.rest<double>()) {
    const auto i = static_cast<std::int64_t>(sights.size());
    sights.push_back({number, i % 3 == 0 ? place[0] : -number, i % 2 == 0, i % 5 - 1});
  }
  const FreeWater water(sights, begin[0], begin[1], 1e-3 * (1 + widths[0]), 1e-3 * widths[1],
                        (closed & 1) != 0, beams);
  const FreeWater::Known told = water.ask(place[0], place[1], place[2], place[3]);
  if (told.answer == FreeWater::FREE && !std::isfinite(place[0] + place[1])) __builtin_trap();
  if (told.answer != FreeWater::TAKEN && told.object != -1) __builtin_trap();
  if (told.object < -1 || told.object > 3) __builtin_trap();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  const auto which = input.take<std::uint8_t>();
  if (which % 5 == 0) centroids(input);
  if (which % 5 == 1 || which % 5 == 2) inverse(input, which % 5 == 1);
  [[maybe_unused]] static volatile double kept;  // so that nothing is left out as unused
  if (which % 5 == 3) kept = innovations(input);
  if (which % 5 == 4) free_water(input);
  return 0;
}
