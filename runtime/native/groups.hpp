// Patches sorted by object.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "patches.hpp"

namespace twinscrew {

// The patches of each object side by side; objects in order of their first fragment.
class Groups {
 public:
  explicit Groups(std::size_t patches) {
    for (auto* numbers : {&order_, &object_}) numbers->reserve(patches);
    begins_.reserve(patches + 1);
  }

  void operator()(PatchMap& map) {
    const std::vector<Patch>& patches = map.patches();
    object_.resize(patches.size());
    order_.resize(patches.size());
    for (std::size_t i = 0; i < patches.size(); ++i) object_[i] = map.object_of(patches[i]);
    std::iota(order_.begin(), order_.end(), 0);
    std::sort(order_.begin(), order_.end(), [&](std::int32_t a, std::int32_t b) {
      const std::int32_t i = object(a), j = object(b);
      return i != j ? i < j : a < b;
    });
    begins_.clear();
    for (std::size_t i = 0; i < order_.size(); ++i) {
      if (i == 0 || object(order_[i]) != object(order_[i - 1])) begins_.push_back(i);
    }
    begins_.push_back(order_.size());
  }

  std::size_t size() const { return begins_.size() - 1; }

  // The numbers of a group's patches; they may be put in another order.
  std::span<std::int32_t> operator[](std::size_t group) {
    return {order_.data() + begins_[group], begins_[group + 1] - begins_[group]};
  }

 private:
  std::int32_t object(std::int32_t patch) const {
    return object_[static_cast<std::size_t>(patch)];
  }

  std::vector<std::int32_t> order_;   // patches, those of one object together
  std::vector<std::int32_t> object_;  // of each patch
  std::vector<std::size_t> begins_{0};
};

}  // namespace twinscrew
