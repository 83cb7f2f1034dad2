#include "beams.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace twinscrew {
namespace {

constexpr double kPi = std::numbers::pi;

double wrap(double angle) { return std::remainder(angle, 2 * kPi); }

}  // namespace

Beams::Beams(std::span<const double> elevations, std::span<const double> azimuths)
    : elevation(elevations.begin(), elevations.end()), column(azimuths.size()) {
  for (const double e : elevations) {
    cos_elevation.push_back(std::cos(e));
    sin_elevation.push_back(std::sin(e));
  }
  std::iota(column.begin(), column.end(), 0);
  std::ranges::stable_sort(column, {}, [&](std::int32_t c) { return wrap(azimuths[c]); });
  for (const std::int32_t c : column) {
    azimuth.push_back(wrap(azimuths[c]));
    cos_azimuth.push_back(std::cos(azimuths[c]));
    sin_azimuth.push_back(std::sin(azimuths[c]));
  }
}

std::array<Run, 2> Beams::columns_in(const Window& window) const {
  const auto run = [&](double low, double high) -> Run {
    const auto begin = std::lower_bound(azimuth.begin(), azimuth.end(), low - kMargin);
    const auto end = std::upper_bound(begin, azimuth.end(), high + kMargin);
    return {static_cast<std::size_t>(begin - azimuth.begin()),
            static_cast<std::size_t>(end - azimuth.begin())};
  };
  if (window.half_azimuth >= kPi) return {Run{0, columns()}, Run{0, 0}};
  const double centre = wrap(window.azimuth);
  const double low = centre - window.half_azimuth, high = centre + window.half_azimuth;
  if (low < -kPi) return {run(-kPi, high), run(low + 2 * kPi, kPi)};
  if (high > kPi) return {run(low, kPi), run(-kPi, high - 2 * kPi)};
  return {run(low, high), Run{0, 0}};
}

}  // namespace twinscrew
