// The sensor's beam pattern: a grid of elevations and azimuths, and which beams lie in a window.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace twinscrew {

/// [rad] Rounding of a window's edge must not lose a beam.
inline constexpr double kMargin = 1e-9;

/// Angles that contain an object as the sensor sees it; azimuth is centre and half width.
struct Window {
  double elevation_low, elevation_high;
  double azimuth, half_azimuth;

  bool contains_elevation(double e) const {
    return e >= elevation_low - kMargin && e <= elevation_high + kMargin;
  }
};

/// A run of columns in order of azimuth, [begin, end).
struct Run {
  std::size_t begin, end;
};

/// Beam (row, column) has the direction (cos e cos a, cos e sin a, -sin e), forward-starboard-down:
/// elevation is positive upwards, azimuth clockwise as seen from above.
class Beams {
 public:
  Beams(std::span<const double> elevations, std::span<const double> azimuths);

  std::size_t rows() const { return cos_elevation.size(); }
  std::size_t columns() const { return cos_azimuth.size(); }

  /// Columns within the window: at most two runs, because azimuth wraps round.
  std::array<Run, 2> columns_in(const Window& window) const;

  std::vector<double> elevation, cos_elevation, sin_elevation;  // in the sensor's order of rows
  std::vector<double> azimuth, cos_azimuth, sin_azimuth;        // in ascending order of azimuth
  std::vector<std::int32_t> column;  // the sensor's column of each ascending azimuth
};

}  // namespace twinscrew
