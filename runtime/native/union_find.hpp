// Disjoint sets of numbers, kept between scans so that nothing is allocated while scanning.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace twinscrew {

// Union by smaller number with path halving: the smallest member is the root, so the roots do not
// depend on the order of the unions.
class UnionFind {
 public:
  void reserve(std::size_t count) { parent_.reserve(count); }
  void clear() { parent_.clear(); }
  std::size_t size() const { return parent_.size(); }

  std::int32_t add() {
    parent_.push_back(static_cast<std::int32_t>(parent_.size()));
    return parent_.back();
  }

  void add(int count) {
    for (int i = 0; i < count; ++i) add();
  }

  std::int32_t find(std::int32_t a) {
    while (at(a) != a) a = at(a) = at(at(a));
    return a;
  }

  void unite(std::int32_t a, std::int32_t b) {
    a = find(a);
    b = find(b);
    if (a < b) {
      at(b) = a;
    } else {
      at(a) = b;
    }
  }

 private:
  std::int32_t& at(std::int32_t a) { return parent_[static_cast<std::size_t>(a)]; }
  std::vector<std::int32_t> parent_;
};

}  // namespace twinscrew
