// What the visible centroids of a scan say of where things are. Derivation and figures:
// docs/tracking.md; tests/reference/measurement.py is the same in numpy.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace twinscrew {

struct CentroidRules {
  std::vector<double> range, depth;          // [m] a hull's centre is this far behind its centroid
  double small_depth;                        // [m] a buoy's
  double buoy, hull;                         // [m] radii up to and from which a thing is one
  double along, across;                      // [-] of the radius: how far off that may be
  double row_spread, row;                    // [1/m], [rad] and by the squared gap between rows
  double sigma, scatter, jump;               // [m], [-], [-]
  double edge, edge_sigma;                   // [m], [-]
};

// From where, and with which heading's cosine and sine, the scan was taken.
struct Viewpoint {
  double north, east, cosine, sine;
  bool finite() const {
    return std::isfinite(north) && std::isfinite(east) && std::isfinite(cosine);
  }
};

struct CentroidRow {
  std::array<double, 2> z;   // [m] the centre, north and east
  std::array<double, 12> H;  // (2, 6) what it says of the state
  std::array<double, 4> R;   // [m2] (2, 2)
  double radius, gate;       // [m], [m2]
};

class CentroidModel {
 public:
  explicit CentroidModel(CentroidRules rules) : rules_(std::move(rules)) {}

  // A thing at x forward, y starboard [m], of which there are this many echoes.
  CentroidRow row(double x, double y, double radius, std::int64_t points, const Viewpoint& own) const {
    const double north = own.cosine * x - own.sine * y, east = own.sine * x + own.cosine * y;
    const double distance = std::hypot(north, east), least = std::max(distance, 1e-9);
    const double u = north / least, v = east / least;  // the line of sight
    const double behind = depth(distance, radius);
    const double scattered = rules_.scatter * radius;
    const double cut = distance > rules_.edge ? rules_.edge_sigma * radius : 0.0;
    const auto echoes = static_cast<double>(std::max<std::int64_t>(points, 1));
    const double variance =
        rules_.sigma * rules_.sigma + scattered * scattered / echoes + cut * cut;
    const double gate = rules_.jump * radius;
    return {{own.north + north + u * behind, own.east + east + v * behind},
            {1, 0, 0, 0, -u, v, 0, 1, 0, 0, -v, -u},
            {variance, 0, 0, variance},
            radius,
            gate * gate};
  }

  // How far a centroid may be off, along and across the line of sight [m2].
  std::array<double, 2> variance(double distance, double radius) const {
    const double gap = rules_.row * distance;
    const double missed = rules_.row_spread * hull_share(radius) * gap * gap;
    const auto of = [&](double share) { return radius * share * radius * share + missed * missed; };
    return {of(rules_.along), of(rules_.across)};
  }

 private:
  double hull_share(double radius) const {
    return std::clamp((radius - rules_.buoy) / (rules_.hull - rules_.buoy), 0.0, 1.0);
  }

  double depth(double distance, double radius) const {
    return rules_.small_depth + hull_share(radius) * (hull_depth(distance) - rules_.small_depth);
  }

  // Linear between the table's rows, constant outside.
  double hull_depth(double distance) const {
    const std::vector<double>&r = rules_.range, &d = rules_.depth;
    if (distance <= r.front()) return d.front();
    for (std::size_t i = 1; i < r.size(); ++i) {
      if (distance < r[i]) {
        return d[i - 1] + (distance - r[i - 1]) / (r[i] - r[i - 1]) * (d[i] - d[i - 1]);
      }
    }
    return d.back();
  }

  CentroidRules rules_;
};

}  // namespace twinscrew
