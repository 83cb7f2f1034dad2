#include "raycast.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace twinscrew {

Caster::Caster(Beams beams, double range_min, double range_max)
    : beams_(std::move(beams)),
      range_min_(range_min),
      range_max_(range_max),
      depth_(beams_.rows() * beams_.columns(), kMiss),
      body_(depth_.size(), -1),
      touched_(beams_.rows(), Touched{beams_.columns(), 0}) {}

std::size_t Caster::add_shape(Shape shape) {
  shapes_.emplace_back();
  radius_.push_back(0);
  for (Solid& solid : shape) add_to(shapes_.size() - 1, std::move(solid));
  return shapes_.size() - 1;
}

void Caster::add_to(std::size_t shape, Solid solid) {
  const double far = std::sqrt(dot(solid.X_OP.p, solid.X_OP.p)) +
                     std::sqrt(dot(solid.half, solid.half));
  radius_[shape] = std::max(radius_[shape], far);
  shapes_[shape].push_back(std::move(solid));
}

void Caster::mount(std::size_t own_shape, const Pose& X_BS) {
  const Placed placed{inverse(X_BS), {0, 0, 0}, kMiss, 0};
  for (const Solid& solid : shapes_[own_shape]) draw(solid, placed);
  std::vector<std::int32_t> beam(depth_.size()), body(depth_.size());
  std::vector<double> range(depth_.size());
  Echoes echoes{beam, range, body};
  const std::size_t count = collect(echoes);
  own_echoes_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    own_echoes_.push_back({static_cast<std::size_t>(beam[i]), range[i]});
  }
}

std::size_t Caster::cast(const Pose& X_NS, std::span<const Body> bodies, std::size_t own,
                         Echoes& out) {
  for (const OwnEcho& echo : own_echoes_) {
    keep(echo.beam / beams_.columns(), echo.beam % beams_.columns(), echo.range,
         static_cast<std::int32_t>(own));
  }
  const Pose X_SN = inverse(X_NS);
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const Body& body = bodies[i];
    if (i == own || body.shape < 0) continue;
    const auto shape = static_cast<std::size_t>(body.shape);
    const Placed placed{compose(X_SN, body.X_NO), row(X_NS.R, 2), body.water_z - X_NS.p[2],
                        static_cast<std::int32_t>(i)};
    const double distance = std::sqrt(dot(placed.X_SO.p, placed.X_SO.p));
    if (distance - radius_[shape] > range_max_) continue;
    for (const Solid& solid : shapes_[shape]) draw(solid, placed);
  }
  return collect(out);
}

void Caster::draw(const Solid& solid, const Placed& placed) {
  const Pose X_SP = compose(placed.X_SO, solid.X_OP);
  const View seen = view(solid, X_SP);
  if (seen.nearest > range_max_) return;
  const auto runs = beams_.columns_in(seen.window);
  const Vec3 origin_P = inverse(X_SP).p;
  const Vec3 x_P = row(X_SP.R, 0), y_P = row(X_SP.R, 1), z_P = row(X_SP.R, 2);

  for (std::size_t r = 0; r < beams_.rows(); ++r) {
    if (!seen.window.contains_elevation(beams_.elevation[r])) continue;
    const double ce = beams_.cos_elevation[r], se = beams_.sin_elevation[r];
    for (const Run& run : runs) {
      for (std::size_t i = run.begin; i < run.end; ++i) {
        const Vec3 d_S{ce * beams_.cos_azimuth[i], ce * beams_.sin_azimuth[i], -se};
        Vec3 d_P;
        for (int k = 0; k < 3; ++k) d_P[k] = d_S[0] * x_P[k] + d_S[1] * y_P[k] + d_S[2] * z_P[k];
        const double t = enter(solid, origin_P, d_P);
        const bool dry = t * dot(d_S, placed.down_S) <= placed.clearance;
        if (t >= range_min_ && t <= range_max_ && dry) {
          keep(r, static_cast<std::size_t>(beams_.column[i]), t, placed.body);
        }
      }
    }
  }
}

void Caster::keep(std::size_t row, std::size_t column, double range, std::int32_t body) {
  const std::size_t beam = row * beams_.columns() + column;
  if (range >= depth_[beam]) return;
  depth_[beam] = range;
  body_[beam] = body;
  touched_[row].begin = std::min(touched_[row].begin, column);
  touched_[row].end = std::max(touched_[row].end, column + 1);
}

std::size_t Caster::collect(Echoes& out) {
  std::size_t count = 0;
  for (std::size_t r = 0; r < beams_.rows(); ++r) {
    for (std::size_t c = touched_[r].begin; c < touched_[r].end; ++c) {
      const std::size_t beam = r * beams_.columns() + c;
      if (depth_[beam] == kMiss) continue;
      out.beam[count] = static_cast<std::int32_t>(beam);
      out.range[count] = depth_[beam];
      out.body[count] = body_[beam];
      ++count;
      depth_[beam] = kMiss;
    }
    touched_[r] = {beams_.columns(), 0};
  }
  return count;
}

}  // namespace twinscrew
