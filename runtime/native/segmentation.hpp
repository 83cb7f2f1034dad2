// The paper's Algorithm 1 on a range image: runs along the rows, united across them.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "lanes.hpp"
#include "range_image.hpp"
#include "scanner.hpp"
#include "union_find.hpp"

namespace twinscrew {

struct Criterion {
  double theta = 0.0;  // [rad] the paper's threshold
  double noise = 0.0;  // [m] a difference of ranges that noise alone may make
  int bridged = 0;     // [-] missing echoes that a link may cross
};

// Links neighbours p, q if atan2(d2 sin a, d1 - d2 cos a) > theta, with d1 >= d2 their ranges and
// a the angle between their beams. For 0 < a, theta < pi that is
//     d1 < k d2,   k = cos a + sin a / tan theta,
// so one k for each pair of neighbouring directions holds all the trigonometry. The noise floor
// is added on the right.
//
// Links are bits, 64 columns to a word: bit c of a word says that column c is linked to the nearest
// echo on its left, or below it. What is nearest follows from the occupancy alone.
class Segmentation {
 public:
  Segmentation(const Scanner& scanner, const Criterion& criterion, std::size_t cells)
      : noise_(static_cast<float>(criterion.noise)),
        reach_(std::min(criterion.bridged, RangeImage::MARGIN - 2) + 1),
        along_(static_cast<std::size_t>(scanner.rows() * reach_)),
        across_(along_.size()) {
    const auto& e = scanner.elevations();
    for (int row = 0; row < scanner.rows(); ++row) {
      const auto r = static_cast<std::size_t>(row);
      for (int gap = 1; gap <= reach_; ++gap) {
        // Two beams of one elevation, `gap` columns apart: spherical law of cosines.
        const double c = std::cos(e[r]), s = std::sin(e[r]);
        const double cosine = s * s + c * c * std::cos(gap * scanner.azimuth_step());
        along_[index(row, gap)] = k(std::acos(std::clamp(cosine, -1.0, 1.0)), criterion.theta);
        const double angle = row >= gap ? e[r] - e[r - static_cast<std::size_t>(gap)] : 0.0;
        across_[index(row, gap)] = k(angle, criterion.theta);
      }
    }
    runs_.reserve(cells);
    compact_.reserve(cells);
  }

  // Gives every run, and so every occupied cell, a label, 0, 1, .. in order of a component's first
  // cell; and their number.
  std::int32_t operator()(const RangeImage& image, bool wraps) {
    runs_.clear();
    starts_.resize(static_cast<std::size_t>(image.rows()) * image.words());
    first_run_.resize(starts_.size());
    for (int row = 0; row < image.rows(); ++row) {
      find_runs(image, row);
      for (int gap = 1; gap <= std::min(reach_, row); ++gap) unite_with(image, row, gap);
      if (wraps) close(image, row);
    }
    return number_components();
  }

  // Of each word of the image: the columns where runs start, and the number of its first start.
  const std::vector<std::uint64_t>& starts() const { return starts_; }
  const std::vector<std::int32_t>& first_run() const { return first_run_; }
  // Of each run.
  const std::vector<std::int32_t>& labels() const { return compact_; }
  // Of an occupied cell.
  std::int32_t label(std::size_t cell) const {
    const auto at = static_cast<int>(cell % RangeImage::WORD);
    return compact_[static_cast<std::size_t>(run(cell / RangeImage::WORD, at))];
  }

 private:
  using Word = std::uint64_t;
  static constexpr std::int32_t NONE = -1;

  static float k(double angle, double theta) {
    return static_cast<float>(std::cos(angle) + std::sin(angle) / std::tan(theta));
  }

  std::size_t index(int row, int gap) const {
    return static_cast<std::size_t>(row * reach_ + gap - 1);
  }

  bool linked(float p, float q, float k) const {
    const float far = p < q ? q : p, near = p < q ? p : q;
    return far < k * near + noise_;
  }

  // Which of the 64 cells from p on are linked to the cell in the same place from q on.
  static Word linked(const float* p, const float* q, Word candidates, float k, float noise) {
    Word links = 0;
    for (unsigned lane = 0; lane < RangeImage::WORD; lane += LANES) {
      if (((candidates >> lane) & 15U) == 0) continue;
      const Float4 a = load(p + lane), b = load(q + lane);
      const Int4 less = a < b;
      const Int4 link = select(less, b, a) < select(less, a, b) * k + noise;
      links |= Word{bits(link)} << lane;
    }
    return links & candidates;
  }

  // Splits a row into runs of echoes linked to each other; the first of each starts it.
  void find_runs(const RangeImage& image, int row) {
    const Word* const occupied = image.row_words(row);
    const float* const ranges = image.ranges() + image.cell(row, 0);
    Word before = 0;  // the word on the left
    for (std::size_t w = 0; w < image.words(); ++w) {
      const Word here = occupied[w];
      Word joined = 0, empty = ~Word{0};  // empty: no echo yet between a column and `gap` before it
      for (int gap = 1; here != 0 && gap <= reach_; ++gap) {
        const Word left = here << gap | before >> (RangeImage::WORD - static_cast<unsigned>(gap));
        const Word candidates = here & left & empty;
        empty &= ~left;
        if (candidates == 0) continue;
        const float* const p = ranges + w * RangeImage::WORD;
        joined |= linked(p, p - gap, candidates, along_[index(row, gap)], noise_);
      }
      before = here;
      const std::size_t at = static_cast<std::size_t>(row) * image.words() + w;
      starts_[at] = here & ~joined;
      first_run_[at] = static_cast<std::int32_t>(runs_.size());
      runs_.add(std::popcount(starts_[at]));
    }
  }

  // Unites the runs of a row with those `gap` rows lower, where there is no echo between.
  void unite_with(const RangeImage& image, int row, int gap) {
    const std::size_t words = image.words();
    const auto under = static_cast<std::size_t>(gap) * words;
    const Word* const occupied = image.row_words(row);
    const float* const ranges = image.ranges() + image.cell(row, 0);
    const float* const lower = image.ranges() + image.cell(row - gap, 0);
    const float factor = across_[index(row, gap)];
    Word carry = 0;  // the last link of the word on the left
    for (std::size_t w = 0; w < words; ++w) {
      Word candidates = occupied[w] & image.row_words(row - gap)[w];
      for (int between = 1; between < gap; ++between) {
        candidates &= ~image.row_words(row - between)[w];
      }
      if (candidates == 0) {
        carry = 0;
        continue;
      }
      const std::size_t at = static_cast<std::size_t>(row) * words + w;
      const std::size_t column = w * RangeImage::WORD;
      const Word links = linked(ranges + column, lower + column, candidates, factor, noise_);
      // A link says nothing new if the one on its left joins the same two runs.
      Word news = links & (~(links << 1 | carry) | starts_[at] | starts_[at - under]);
      carry = links >> (RangeImage::WORD - 1);
      for (; news != 0; news &= news - 1) {
        const int bit = std::countr_zero(news);
        runs_.unite(run(at, bit), run(at - under, bit));
      }
    }
  }

  // Unites a row's last run with its first one, if the image's ends are neighbours.
  void close(const RangeImage& image, int row) {
    const int first = image.first_in_row(row), last = image.last_in_row(row);
    const int gap = first + image.columns() - last;
    if (first < 0 || first == last || gap > reach_) return;
    const float p = image.range(image.cell(row, first)), q = image.range(image.cell(row, last));
    if (!linked(p, q, along_[index(row, gap)])) return;
    runs_.unite(run_at(image, row, first), run_at(image, row, last));
  }

  std::int32_t run_at(const RangeImage& image, int row, int column) const {
    const auto c = static_cast<unsigned>(column);
    return run(static_cast<std::size_t>(row) * image.words() + c / RangeImage::WORD,
               static_cast<int>(c % RangeImage::WORD));
  }

  // The run of an occupied cell.
  std::int32_t run(std::size_t word, int bit) const {
    const Word up_to = (Word{2} << bit) - 1;
    return first_run_[word] + std::popcount(starts_[word] & up_to) - 1;
  }

  std::int32_t number_components() {
    compact_.assign(runs_.size(), NONE);
    std::int32_t components = 0;
    for (std::size_t run = 0; run < runs_.size(); ++run) {
      // The root is a component's smallest run, so it has been numbered before its members.
      const auto root = static_cast<std::size_t>(runs_.find(static_cast<std::int32_t>(run)));
      compact_[run] = root == run ? components++ : compact_[root];
    }
    return components;
  }

  float noise_;
  int reach_;
  std::vector<float> along_, across_;    // k, one for each row and gap
  std::vector<Word> starts_;             // of each word of the image: where runs start
  std::vector<std::int32_t> first_run_;  // of each word: the number of its first start
  std::vector<std::int32_t> compact_;    // of each run: its component
  UnionFind runs_;
};

}  // namespace twinscrew
