#include "vessel_step.hpp"

#include <algorithm>
#include <cmath>

namespace twinscrew::vessel {
namespace {

Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec3 operator*(double s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
Six operator+(Six a, Six b) { return {a.linear + b.linear, a.angular + b.angular}; }
Six operator-(Six a, Six b) { return {a.linear - b.linear, a.angular - b.angular}; }

double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

std::array<double, 6> flat(Six a) {
  return {a.linear.x, a.linear.y, a.linear.z, a.angular.x, a.angular.y, a.angular.z};
}

Six operator*(const Matrix6& A, Six b) {
  const auto v = flat(b);
  std::array<double, 6> out{};
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = 0; j < 6; ++j) out[i] += A[i][j] * v[j];
  return {{out[0], out[1], out[2]}, {out[3], out[4], out[5]}};
}

/// R_NB as its rows: the axes of N, expressed in B.
struct Rotation {
  Vec3 north, east, down;  // rows

  explicit Rotation(Quaternion q)  // Fossen (2021), chapter 2
      : north{1 - 2 * (q.y * q.y + q.z * q.z), 2 * (q.x * q.y - q.z * q.w),
              2 * (q.x * q.z + q.y * q.w)},
        east{2 * (q.x * q.y + q.z * q.w), 1 - 2 * (q.x * q.x + q.z * q.z),
             2 * (q.y * q.z - q.x * q.w)},
        down{2 * (q.x * q.z - q.y * q.w), 2 * (q.y * q.z + q.x * q.w),
             1 - 2 * (q.x * q.x + q.y * q.y)} {}

  Vec3 to_world(Vec3 a_B) const { return {dot(north, a_B), dot(east, a_B), dot(down, a_B)}; }
  Vec3 to_body(Vec3 a_N) const { return a_N.x * north + a_N.y * east + a_N.z * down; }
};

Six wrench(Vec3 force, Vec3 position) { return {force, cross(position, force)}; }

/// C(nu) nu by Kirchhoff's equations. Fossen (2021), chapter 3.
Six coriolis(const Matrix6& M, Six nu) {
  const Six momentum = M * nu;
  return {cross(nu.angular, momentum.linear),
          cross(nu.linear, momentum.linear) + cross(nu.angular, momentum.angular)};
}

/// D(nu) nu, diagonal. Fossen (2021), chapter 6.
Six damping(const Model& model, Six nu) {
  auto v = flat(nu);
  for (std::size_t i = 0; i < 6; ++i)
    v[i] *= model.linear_drag[i] + model.quadratic_drag[i] * std::abs(v[i]);
  return {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
}

double surface_height(const Sea& sea, Vec3 p_N) {
  double height = 0.0;
  for (const Wave& w : sea.waves)
    height += w.amplitude * std::cos(p_N.x * w.k_north + p_N.y * w.k_east -
                                     w.frequency * sea.time + w.phase);
  return height * sea.growth;
}

/// Area of a circle's segment of a height in [0, radius].
double segment_area(double radius, double height) {
  const double rest = radius - height;
  return radius * radius * std::acos(rest / radius) -
         rest * std::sqrt(radius * radius - rest * rest);
}

/// The hulls' buoyancy at the wave surface, straight up at every keel point (VRX 2.3.2).
Six lift(const Model& model, Vec3 position, const Rotation& R, const Sea& sea) {
  Six total;
  for (const Vec3 point_B : model.keel) {
    const Vec3 p_N = position + R.to_world(point_B);
    const double wet = std::clamp(p_N.z + surface_height(sea, p_N), 0.0, model.hull_radius);
    const double up = model.lift_per_area * segment_area(model.hull_radius, wet);
    total = total + wrench(-up * R.down, point_B);
  }
  return total;
}

/// Fossen (2021), chapter 10, in VRX's form; `wind` is the air's velocity relative to the vessel.
Six air(const Model& model, const Rotation& R, Vec3 wind_N) {
  if (model.wind_world_frame) {
    const double u = wind_N.y, v = wind_N.x;  // east, north
    return {R.to_body({model.wind_across * v * std::abs(v), model.wind_along * u * std::abs(u), 0}),
            R.to_body({0, 0, 2 * model.wind_yaw * u * v})};
  }
  const Vec3 w = R.to_body(wind_N);
  return {{model.wind_along * w.x * std::abs(w.x), model.wind_across * w.y * std::abs(w.y), 0},
          {0, 0, -2 * model.wind_yaw * w.x * w.y}};
}

Six push(const Model& model, const std::array<double, 2>& thrust) {
  return wrench({thrust[0], 0, 0}, model.propeller[0]) +
         wrench({thrust[1], 0, 0}, model.propeller[1]);
}

/// q turned by a rotation vector in B [rad]. Fossen (2021), chapter 2.
Quaternion turn(Quaternion q, Vec3 angle) {
  const double size = std::sqrt(dot(angle, angle));
  const double c = std::cos(0.5 * size);
  const double s = size > 0.0 ? std::sin(0.5 * size) / size : 0.5;
  const Vec3 v{q.x, q.y, q.z}, d = s * angle;
  const Vec3 t = q.w * d + c * v + cross(v, d);
  const double w = q.w * c - dot(v, d);
  const double norm = std::sqrt(w * w + dot(t, t));
  return {w / norm, t.x / norm, t.y / norm, t.z / norm};
}

/// The thrust a step later: first-order lag, then no faster than the slew limit.
double followed(double thrust, double command, const Model& model, double dt) {
  const double lag = model.thrust_lag, most = model.thrust_slew * dt;
  const double next = lag == 0.0 ? command : command + (thrust - command) * std::exp(-dt / lag);
  return std::abs(next - thrust) <= most ? next : thrust + std::copysign(most, next - thrust);
}

}  // namespace

Six acceleration(const Model& model, const State& state, const Sea& sea) {
  const Rotation R(state.attitude);
  const Six nu_r{state.velocity - R.to_body(sea.current), state.rates};
  const Vec3 wind_N = sea.wind - R.to_world(state.velocity);
  const Six tau = push(model, state.thrust) + wrench(model.weight * R.down, model.centre) +
                  lift(model, state.position, R, sea) + air(model, R, wind_N) -
                  coriolis(model.M, nu_r) - damping(model, nu_r);
  return model.M_inverse * tau;
}

State step(const Model& model, const State& state, std::array<double, 2> command, const Sea& sea,
           double dt) {
  State next = state;
  for (std::size_t i = 0; i < 2; ++i)
    next.thrust[i] = followed(
        state.thrust[i], std::clamp(command[i], model.thrust_min, model.thrust_max), model, dt);
  const Six nu_dot = acceleration(model, next, sea);
  const Rotation R(state.attitude);
  const Vec3 velocity_r = state.velocity - R.to_body(sea.current) + dt * nu_dot.linear;
  next.rates = state.rates + dt * nu_dot.angular;
  next.position = state.position + dt * (R.to_world(velocity_r) + sea.current);
  next.attitude = turn(state.attitude, dt * next.rates);
  next.velocity = velocity_r + Rotation(next.attitude).to_body(sea.current);
  return next;
}

}  // namespace twinscrew::vessel
