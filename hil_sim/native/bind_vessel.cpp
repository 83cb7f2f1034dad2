// Python bindings of the vessel: check the arguments, release the GIL, call the pure C++ core.
#include "arrays.hpp"
#include "vessel_step.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace twinscrew::vessel {
namespace {

Vec3 vec3(const double* a) { return {a[0], a[1], a[2]}; }

Matrix6 matrix6(const In<6, 6>& a) {
  Matrix6 A;
  for (std::size_t i = 0; i < 6; ++i) std::copy_n(a.data() + 6 * i, 6, A[i].begin());
  return A;
}

std::array<double, 6> six(const In<6>& a) {
  std::array<double, 6> out;
  std::copy_n(a.data(), 6, out.begin());
  return out;
}

Model make_model(In<6, 6> mass, In<6, 6> mass_inverse, In<6> linear_drag, In<6> quadratic_drag,
                 double weight_n, In<3> centre_B, In<-1, 3> keel_B, double hull_radius_m,
                 double lift_per_area, In<2, 3> propellers_B, In<4> thrust, In<3> windage,
                 bool wind_world_frame) {
  require(finite(mass) && finite(mass_inverse) && finite(linear_drag) && finite(quadratic_drag) &&
              finite(centre_B) && finite(keel_B) && finite(propellers_B) && finite(windage) &&
              std::isfinite(thrust(0)) && std::isfinite(thrust(1)) && std::isfinite(thrust(2)),
          "a vessel's numbers must be finite");
  require(hull_radius_m > 0, "a hull needs a radius");
  require(thrust(0) <= thrust(1) && thrust(2) >= 0 && thrust(3) > 0,
          "thrust is (least, greatest, lag, slew)");
  std::vector<Vec3> keel;
  for (std::size_t i = 0; i < keel_B.shape(0); ++i) keel.push_back(vec3(keel_B.data() + 3 * i));
  return {.M = matrix6(mass),
          .M_inverse = matrix6(mass_inverse),
          .linear_drag = six(linear_drag),
          .quadratic_drag = six(quadratic_drag),
          .weight = weight_n,
          .centre = vec3(centre_B.data()),
          .keel = std::move(keel),
          .hull_radius = hull_radius_m,
          .lift_per_area = lift_per_area,
          .propeller = {vec3(propellers_B.data()), vec3(propellers_B.data() + 3)},
          .thrust_min = thrust(0),
          .thrust_max = thrust(1),
          .thrust_lag = thrust(2),
          .thrust_slew = thrust(3),
          .wind_along = windage(0),
          .wind_across = windage(1),
          .wind_yaw = windage(2),
          .wind_world_frame = wind_world_frame};
}

/// The sea but for its current, which every vessel has its own of.
Sea make_sea(const In<-1, 5>& waves, double growth, const In<2>& wind, const In<-1, 2>& current,
             std::size_t vessels, double time_s) {
  require(current.shape(0) == vessels, "every array must have one row a vessel");
  static_assert(sizeof(Wave) == 5 * sizeof(double));
  require(finite(waves) && finite(wind) && finite(current) && std::isfinite(growth * time_s),
          "the sea must be finite");
  return {{reinterpret_cast<const Wave*>(waves.data()), waves.shape(0)},
          growth,
          time_s,
          {wind(0), wind(1), 0.0},
          {0.0, 0.0, 0.0}};
}

Vec3 current_of(const In<-1, 2>& current, std::size_t i) {
  return {current(i, 0), current(i, 1), 0.0};
}

/// The arrays of V vessels, as VesselState holds them.
template <typename T>
struct Fleet {
  Array<T, -1, 3> position;
  Array<T, -1, 4> attitude;
  Array<T, -1, 3> velocity, rates;
  Array<T, -1, 2> thrust;

  std::size_t size() const { return position.shape(0); }

  void check() const {
    const std::size_t count = size();
    require(attitude.shape(0) == count && velocity.shape(0) == count && rates.shape(0) == count &&
                thrust.shape(0) == count,
            "every array must have one row a vessel");
  }

  bool all_finite() const {
    return finite(position) && finite(attitude) && finite(velocity) && finite(rates) &&
           finite(thrust);
  }

  State get(std::size_t i) const {
    const T* q = attitude.data() + 4 * i;
    const T* t = thrust.data() + 2 * i;
    return {vec3(position.data() + 3 * i), {q[0], q[1], q[2], q[3]}, vec3(velocity.data() + 3 * i),
            vec3(rates.data() + 3 * i), {t[0], t[1]}};
  }

  void set(std::size_t i, const State& s) const {
    const auto put = [i](const Array<T, -1, 3>& a, Vec3 v) {
      T* row = a.data() + 3 * i;
      row[0] = v.x, row[1] = v.y, row[2] = v.z;
    };
    put(position, s.position);
    put(velocity, s.velocity);
    put(rates, s.rates);
    const std::array<double, 4> q{s.attitude.w, s.attitude.x, s.attitude.y, s.attitude.z};
    std::copy_n(q.begin(), 4, attitude.data() + 4 * i);
    std::copy_n(s.thrust.begin(), 2, thrust.data() + 2 * i);
  }
};

void step_all(const Model& model, In<-1, 3> position_N, In<-1, 4> q_NB, In<-1, 3> velocity_B,
              In<-1, 3> rates_B, In<-1, 2> thrust, In<-1, 2> command, In<-1, 5> waves,
              double growth, In<2> wind_N, In<-1, 2> current_N, double time_s, double dt_s,
              Out<-1, 3> next_position_N, Out<-1, 4> next_q_NB, Out<-1, 3> next_velocity_B,
              Out<-1, 3> next_rates_B, Out<-1, 2> next_thrust) {
  const Fleet<const double> now{position_N, q_NB, velocity_B, rates_B, thrust};
  const Fleet<double> next{next_position_N, next_q_NB, next_velocity_B, next_rates_B, next_thrust};
  now.check();
  next.check();
  require(command.shape(0) == now.size() && next.size() == now.size(),
          "every array must have one row a vessel");
  require(now.all_finite(), "the state must be finite");
  require(finite(command), "the command must be finite");
  require(dt_s > 0 && std::isfinite(dt_s), "a step must be longer than 0");
  Sea sea = make_sea(waves, growth, wind_N, current_N, now.size(), time_s);
  const nb::gil_scoped_release release;
  for (std::size_t i = 0; i < now.size(); ++i) {
    sea.current = current_of(current_N, i);
    next.set(i, step(model, now.get(i), {command(i, 0), command(i, 1)}, sea, dt_s));
  }
}

void accelerate_all(const Model& model, In<-1, 3> position_N, In<-1, 4> q_NB,
                    In<-1, 3> velocity_B, In<-1, 3> rates_B, In<-1, 2> thrust, In<-1, 5> waves,
                    double growth, In<2> wind_N, In<-1, 2> current_N, double time_s,
                    Out<-1, 6> nu_dot) {
  const Fleet<const double> now{position_N, q_NB, velocity_B, rates_B, thrust};
  now.check();
  require(nu_dot.shape(0) == now.size(), "every array must have one row a vessel");
  require(now.all_finite(), "the state must be finite");
  Sea sea = make_sea(waves, growth, wind_N, current_N, now.size(), time_s);
  const nb::gil_scoped_release release;
  for (std::size_t i = 0; i < now.size(); ++i) {
    sea.current = current_of(current_N, i);
    const Six a = acceleration(model, now.get(i), sea);
    const std::array<double, 6> row{a.linear.x,  a.linear.y,  a.linear.z,
                                    a.angular.x, a.angular.y, a.angular.z};
    std::copy_n(row.begin(), 6, nu_dot.data() + 6 * i);
  }
}

}  // namespace
}  // namespace twinscrew::vessel

namespace twinscrew {

void bind_vessel(nb::module_& m) {
  using namespace vessel;
  nb::class_<Model>(m, "VesselModel", "The equations of motion of one kind of vessel.")
      .def(
          "__init__",
          [](Model* self, In<6, 6> mass, In<6, 6> mass_inverse, In<6> linear_drag,
             In<6> quadratic_drag, double weight_n, In<3> centre_B, In<-1, 3> keel_B,
             double hull_radius_m, double lift_per_area, In<2, 3> propellers_B, In<4> thrust,
             In<3> windage, bool wind_world_frame) {
            new (self) Model(make_model(mass, mass_inverse, linear_drag, quadratic_drag, weight_n,
                                        centre_B, keel_B, hull_radius_m, lift_per_area,
                                        propellers_B, thrust, windage, wind_world_frame));
          },
          nb::kw_only(), "mass"_a, "mass_inverse"_a, "linear_drag"_a, "quadratic_drag"_a,
          "weight_n"_a, "centre_B"_a, "keel_B"_a, "hull_radius_m"_a, "lift_per_area"_a,
          "propellers_B"_a, "thrust"_a, "windage"_a, "wind_world_frame"_a)
      .def("step", &step_all, "position_N"_a, "q_NB"_a, "velocity_B"_a, "rates_B"_a, "thrust"_a,
           "command"_a, "waves"_a, "growth"_a, "wind_N"_a, "current_N"_a, "time_s"_a, "dt_s"_a,
           "next_position_N"_a.noconvert(), "next_q_NB"_a.noconvert(),
           "next_velocity_B"_a.noconvert(), "next_rates_B"_a.noconvert(),
           "next_thrust"_a.noconvert())
      .def("acceleration", &accelerate_all, "position_N"_a, "q_NB"_a, "velocity_B"_a, "rates_B"_a,
           "thrust"_a, "waves"_a, "growth"_a, "wind_N"_a, "current_N"_a, "time_s"_a,
           "nu_dot"_a.noconvert());
}

}  // namespace twinscrew
