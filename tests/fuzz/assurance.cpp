// Fuzzes the assurance's foresight: any numbers are a motion, a law and what is around; see run.sh.
#include "assurance.hpp"

#include "input.hpp"

using namespace twinscrew;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static constexpr std::size_t ROW = 6;  // place, velocity, radius, horizon
  static Foresight foresight({{300.0, 350.0, 400.0}, {50.0, 90.0, 120.0}, {30.0, 60.0, 80.0}, 1.0},
                             {{-1.5, 1.3}, {0.0, 1.3}, {1.5, 1.3}}, {24, 0.25, 400.0, 3.0, 0.2});
  Input input(data, size);
  const auto motion = input.take<Planar>();
  const auto thrust = input.take<Thrusts>();
  const auto law = input.take<Law>();
  const auto push = input.take<Push>();
  const std::vector<double> rows = input.rest<double>();
  const std::size_t count = rows.size() / ROW;
  const std::span<const double> all(rows);
  const Surroundings around{all.subspan(0, 2 * count), all.subspan(2 * count, 2 * count),
                            all.subspan(4 * count, count), all.subspan(5 * count, count)};
  const auto path = foresight.sail(motion, thrust, law, push);
  if (path.size() != 25 || path[0] != Planar{}) __builtin_trap();
  const Contact found = foresight.judge(path, around);
  if (!(found.excess >= 0.0)) __builtin_trap();
  if (found.circle >= static_cast<int>(count)) __builtin_trap();
  if ((found.circle < 0) != (found.excess == 0.0)) __builtin_trap();
  // It remembers nothing: the same again is the same.
  const Contact again = foresight.judge(foresight.sail(motion, thrust, law, push), around);
  if (again.excess != found.excess || again.circle != found.circle) __builtin_trap();
  return 0;
}
