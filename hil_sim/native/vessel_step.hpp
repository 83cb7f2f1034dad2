// The equations of motion of a vessel, and one step of semi-implicit Euler.
//
//   M nu_r' + C(nu_r) nu_r + D(nu_r) nu_r = tau_thrust + tau_weight + tau_lift + tau_wind
//
// Fossen (2021), Handbook of Marine Craft Hydrodynamics and Motion Control; docs/simulator.md tells
// which equation is which. N is north-east-down, B forward-starboard-down; moments about base_link.
#pragma once

#include <array>
#include <span>
#include <vector>

namespace twinscrew::vessel {

struct Vec3 {
  double x = 0.0, y = 0.0, z = 0.0;
};

struct Quaternion {
  double w = 1.0, x = 0.0, y = 0.0, z = 0.0;
};

/// A vector of six: forces and moments, or velocities and rates.
struct Six {
  Vec3 linear, angular;
};

using Matrix6 = std::array<std::array<double, 6>, 6>;

/// What does not change: SI units, everything in B.
struct Model {
  Matrix6 M, M_inverse;  // rigid body and added mass, about base_link
  std::array<double, 6> linear_drag, quadratic_drag;
  double weight;  // [N]
  Vec3 centre;    // of gravity
  std::vector<Vec3> keel;
  double hull_radius, lift_per_area;  // [m], [N/m2] of each keel point's wet section
  std::array<Vec3, 2> propeller;
  double thrust_min, thrust_max, thrust_lag, thrust_slew;  // [N], [N], [s], [N/s] or infinite
  double wind_along, wind_across, wind_yaw;
  bool wind_world_frame;  // VRX's quirk: the coefficients go with east and north
};

struct Wave {
  double amplitude, k_north, k_east, frequency, phase;
};

/// The sea at one time.
struct Sea {
  std::span<const Wave> waves;
  double growth;       // [-] share of their height that the waves have reached
  double time;         // [s]
  Vec3 wind, current;  // [m/s] over ground, N
};

struct State {
  Vec3 position;  // N
  Quaternion attitude;
  Vec3 velocity, rates;  // B, over ground
  std::array<double, 2> thrust;
};

/// nu_r' [m/s2, rad/s2]: the acceleration in the frame that moves with the water.
Six acceleration(const Model& model, const State& state, const Sea& sea);

/// The state after dt [s] under a thrust command [N].
State step(const Model& model, const State& state, std::array<double, 2> command, const Sea& sea,
           double dt);

}  // namespace twinscrew::vessel
