// Fuzzes the perception kernel: any bytes are a scan, an attitude and a motion; see run.sh.
#include "kernel.hpp"

#include <vector>

#include "input.hpp"

namespace {

using namespace twinscrew;

Kernel& kernel(std::uint8_t which) {
  static const std::vector<double> even{-0.2, -0.1, 0.0, 0.1, 0.2}, uneven{-0.5, -0.4, 0.0, 0.3};
  static const Scanner round(even, -3.0, 6.283185307179586 / 200.0, 200, true);
  static const Scanner sector(uneven, -0.7, 0.02, 70, false);
  Gates gates;
  gates.range_min = 0.0F;
  gates.mask_hull = gates.drop_water = true;
  gates.hull_aft = -2.0F, gates.hull_fore = 2.0F, gates.hull_half_width = 1.0F;
  gates.clearance = 0.1F, gates.weak_clearance = 0.5F, gates.weak = 10.0F;
  CircleRules rules;
  rules.least_points = 1, rules.has_hull = true;
  rules.hull_aft = gates.hull_aft, rules.hull_fore = gates.hull_fore;
  const FootprintRule footprint{5.5F, 2.9F, 2.2F, 2.2F, 1};
  const Criterion criterion{1.0471975, 0.04, 2};
  const MergeRule merge{0.6F, 0.9F};
  static Kernel one(round, gates, criterion, 23.0F, merge, footprint, rules, 0.3F, 3);
  static Kernel two(sector, gates, criterion, 23.0F, merge, footprint, rules, 0.3F, 1);
  return which % 2 == 0 ? one : two;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  Kernel& k = kernel(input.take<std::uint8_t>());
  const auto flags = input.take<std::uint8_t>();
  const auto X_BS = input.take<Transform>();
  const auto R_LB = input.take<Matrix>();
  const auto motion = input.take<Motion>();
  const std::vector<float> points = input.rest<float>();
  const std::size_t count = points.size() / 3;
  const std::span<const float> values(points.data(), count);
  const Cloud cloud{{points.data(), 3 * count}, flags & 1 ? values : std::span<const float>(),
                    flags & 2 ? values : std::span<const float>()};
  const Transform plain{{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0.4F, 0.0F, -1.9F}};
  const Counts c = k.project(cloud, flags & 4 ? X_BS : plain, flags & 8 ? R_LB : plain.R,
                             flags & 16 ? &motion : nullptr);
  if (c.points != c.empty + c.range + c.no_beam + c.hull + c.water + c.hidden + c.used) __builtin_trap();
  if (k.segment() > c.used) __builtin_trap();
  std::int64_t held = 0;
  for (const Circle& circle : k.objects()) held += circle.count;
  if (held != c.used) __builtin_trap();  // every echo is in one circle: one point is enough
  std::int64_t in_strips = 0;
  for (const Strip& strip : k.strips()) {
    in_strips += strip.count;
    if (strip.circle < 0 || static_cast<std::size_t>(strip.circle) >= k.circles()) __builtin_trap();
  }
  if (in_strips > c.used) __builtin_trap();
  // Cut objects are numbered, and seen where there is an echo.
  std::int32_t last = -1;
  for (const Circle& circle : k.objects()) last = std::max(last, circle.cut_from);
  for (const BoundaryPoint& sight : k.outline()) {
    if (sight.seen < -1 || sight.seen > last) __builtin_trap();
  }
  return 0;
}
