// The range image: which cells hold an echo, how far it is, where, and which point it was.
#pragma once

#include <bit>
#include <cstdint>
#include <vector>

namespace twinscrew {

// Where a cell's echo is in the levelled frame L, and the number of its point.
struct Echo {
  float x, y;           // [m] forward, starboard of the vessel's origin
  std::int32_t square;  // of the horizontal plane
  std::int32_t point;
};

// Occupancy is one bit a cell: clearing and walking cost only what is there. Rows are filled up to
// whole words, so that a cell's number tells its word and its bit.
class RangeImage {
 public:
  static constexpr int WORD = 64;    // columns to a word
  static constexpr int MARGIN = 64;  // cells that may be read before the first; WORD after the last

  RangeImage(int rows, int columns)
      : rows_(rows),
        columns_(columns),
        words_((static_cast<std::size_t>(columns) + WORD - 1) / WORD),
        occupied_(static_cast<std::size_t>(rows) * words_),
        echo_(occupied_.size() * WORD),
        range_(MARGIN + echo_.size() + WORD) {}

  int rows() const { return rows_; }
  int columns() const { return columns_; }
  std::size_t size() const { return echo_.size(); }
  std::size_t words() const { return words_; }

  void clear() { std::fill(occupied_.begin(), occupied_.end(), 0); }

  std::size_t cell(int row, int column) const {
    return static_cast<std::size_t>(row) * words_ * WORD + static_cast<std::size_t>(column);
  }

  // Puts echoes into the image. It holds the word of occupancy that it is at, since most echoes are
  // beside the one before: no later one waits for that word to come back from memory.
  class Pen {
   public:
    explicit Pen(RangeImage& image)
        : occupied_(image.occupied_.data()),
          echo_(image.echo_.data()),
          range_(image.range_.data() + MARGIN),
          bits_(occupied_[0]) {}
    ~Pen() { occupied_[at_] = bits_; }
    Pen(const Pen&) = delete;
    Pen& operator=(const Pen&) = delete;

    // Keeps the nearest echo of a cell. True if the cell was empty.
    bool put(std::size_t cell, float range, const Echo& echo) {
      if (cell / WORD != at_) {
        occupied_[at_] = bits_;
        at_ = cell / WORD;
        bits_ = occupied_[at_];
      }
      const std::uint64_t bit = std::uint64_t{1} << (cell % WORD);
      const bool empty = (bits_ & bit) == 0;
      if (empty || range < range_[cell]) {
        bits_ |= bit;
        range_[cell] = range;
        echo_[cell] = echo;
      }
      return empty;
    }

   private:
    std::uint64_t* const occupied_;
    Echo* const echo_;
    float* const range_;
    std::size_t at_ = 0;
    std::uint64_t bits_;
  };

  // Of all cells; what was not put there in this scan is of no meaning.
  const float* ranges() const { return range_.data() + MARGIN; }
  float range(std::size_t cell) const { return range_[MARGIN + cell]; }
  const Echo* echoes() const { return echo_.data(); }
  const Echo& echo(std::size_t cell) const { return echo_[cell]; }

  // The occupancy of a row, a bit a column, the first column's lowest.
  const std::uint64_t* row_words(int row) const {
    return &occupied_[static_cast<std::size_t>(row) * words_];
  }

  // The first and the last occupied column of a row, -1 if there is none.
  int first_in_row(int row) const {
    const std::uint64_t* const words = row_words(row);
    for (std::size_t w = 0; w < words_; ++w) {
      if (words[w] != 0) return static_cast<int>(w * WORD) + std::countr_zero(words[w]);
    }
    return -1;
  }
  int last_in_row(int row) const {
    const std::uint64_t* const words = row_words(row);
    for (std::size_t w = words_; w-- > 0;) {
      if (words[w] != 0) return static_cast<int>(w * WORD) + std::bit_width(words[w]) - 1;
    }
    return -1;
  }

  // Calls visit(column, cell) for the occupied cells of a row, from left to right.
  template <class Visit>
  void each_in_row(int row, Visit visit) const {
    const std::size_t count = words_, begin = cell(row, 0);
    const std::uint64_t* const words = row_words(row);
    for (std::size_t w = 0; w < count; ++w) {
      for (std::uint64_t bits = words[w]; bits != 0; bits &= bits - 1) {
        const int column = static_cast<int>(w * 64) + std::countr_zero(bits);
        visit(column, begin + static_cast<std::size_t>(column));
      }
    }
  }

  // The same, for those of one stretch of a row, from the cell `first` to the cell `last`.
  template <class Visit>
  void each_between(std::size_t first, std::size_t last, Visit visit) const {
    for (std::size_t w = first / WORD; w <= last / WORD; ++w) {
      const std::size_t at = w * WORD;
      std::uint64_t bits = occupied_[w];
      if (at < first) bits &= ~std::uint64_t{0} << (first - at);
      if (last - at < WORD - 1) bits &= (std::uint64_t{2} << (last - at)) - 1;
      for (; bits != 0; bits &= bits - 1) {
        visit(at + static_cast<std::size_t>(std::countr_zero(bits)));
      }
    }
  }

  // Calls visit(cell) for the occupied cells, lowest row first.
  template <class Visit>
  void each(Visit visit) const {
    for (int row = 0; row < rows_; ++row) {
      each_in_row(row, [&](int, std::size_t at) { visit(at); });
    }
  }

 private:
  int rows_, columns_;
  std::size_t words_;
  std::vector<std::uint64_t> occupied_;
  std::vector<Echo> echo_;
  std::vector<float> range_;  // with its margins
};

}  // namespace twinscrew
