// A LiDAR's scan by ray casting: only the beams within the angles of each solid are tested.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "beams.hpp"
#include "solids.hpp"

namespace twinscrew {

using Shape = std::vector<Solid>;

/// A thing in the world: which shape, where, and the height of the water around it.
struct Body {
  std::int32_t shape;  // negative: not there
  Pose X_NO;
  double water_z;  // [m] down; what lies deeper is hidden by the water
};

/// Where the echoes go: flat beam number (row-major), distance [m], body number.
struct Echoes {
  std::span<std::int32_t> beam;
  std::span<double> range;
  std::span<std::int32_t> body;
};

/// Holds the beam pattern, the shapes and the workspace. One caster serves one thread at a time.
class Caster {
 public:
  Caster(Beams beams, double range_min, double range_max);

  /// Adds a shape and gives its number.
  std::size_t add_shape(Shape shape);

  /// Adds a solid to a shape.
  void add_to(std::size_t shape, Solid solid);

  /// Says what carries the sensor, and where (X_BS). Its parts never move against the sensor, so
  /// they are cast here, once for all scans.
  void mount(std::size_t own_shape, const Pose& X_BS);

  /// Casts every beam; bodies[own] carries the sensor. Echoes come in order of beam number.
  /// Distances under range_min are seen through, as by a depth camera's near clipping plane.
  std::size_t cast(const Pose& X_NS, std::span<const Body> bodies, std::size_t own, Echoes& out);

  const Beams& beams() const { return beams_; }
  std::size_t shapes() const { return shapes_.size(); }

 private:
  struct Placed {
    Pose X_SO;
    Vec3 down_S;       // the world's down in the sensor's axes
    double clearance;  // [m] height of the sensor over the body's water
    std::int32_t body;
  };
  struct OwnEcho {
    std::size_t beam;
    double range;
  };
  struct Touched {
    std::size_t begin, end;
  };

  void draw(const Solid& solid, const Placed& placed);
  void keep(std::size_t row, std::size_t column, double range, std::int32_t body);
  std::size_t collect(Echoes& out);

  Beams beams_;
  double range_min_, range_max_;
  std::vector<Shape> shapes_;
  std::vector<double> radius_;  // [m] of the sphere about a shape's origin that contains it
  std::vector<OwnEcho> own_echoes_;
  std::vector<double> depth_;
  std::vector<std::int32_t> body_;
  std::vector<Touched> touched_;  // columns of each row that may hold an echo
};

}  // namespace twinscrew
