#include "stages/heights/least_steps.h"

#include <algorithm>
#include <limits>

namespace lamina::heights {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

class Search {
 public:
  explicit Search(const Stacks& stacks) : stacks_(stacks), steps_(stacks.end + 1, kFar), via_(stacks.end + 1, UINT32_MAX) {}

  Buffer<std::uint32_t> all() {
    sort_by_layers();
    steps_[stacks_.end] = 0;
    columns_ = {stacks_.end};
    for (std::int32_t layers = stacks_.layers[stacks_.end]; layers-- > 0;) {
      find_rows(layers);
      if (!rows_.empty()) halve(0, rows_.size(), 0, columns_.size() - 1);
      columns_.clear();
      for (const Row& row : rows_) columns_.push_back(row.rung);
    }
    return std::move(via_);
  }

 private:
  // A rung and the columns, [first, last), on which a layer from it may end.
  struct Row {
    std::uint32_t rung;
    std::size_t first, last;
  };

  void sort_by_layers() {
    const std::int32_t most = stacks_.layers[stacks_.end];
    begin_.assign(most + 2, 0);
    const auto counts = [&](std::uint32_t rung) { return stacks_.layers[rung] < most; };
    for (std::uint32_t rung = 0; rung < stacks_.end; ++rung) {
      if (counts(rung)) ++begin_[stacks_.layers[rung] + 1];
    }
    for (std::int32_t layers = 0; layers < most; ++layers) begin_[layers + 1] += begin_[layers];
    rungs_.resize(begin_[most]);
    Buffer<std::uint32_t> next = begin_;
    for (std::uint32_t rung = 0; rung < stacks_.end; ++rung) {
      if (counts(rung)) rungs_[next[stacks_.layers[rung]]++] = rung;
    }
  }

  // The rungs from which a layer reaches a column. Both ends of what they reach only move up.
  void find_rows(std::int32_t layers) {
    rows_.clear();
    std::size_t first = 0, last = 0;
    for (std::uint32_t i = begin_[layers]; i < begin_[layers + 1]; ++i) {
      const std::uint32_t rung = rungs_[i], limit = stacks_.limit[rung];
      if (limit < rung + stacks_.least) continue;
      while (first < columns_.size() && columns_[first] < rung + stacks_.least) ++first;
      while (last < columns_.size() && columns_[last] <= limit) ++last;
      if (first < last) rows_.push_back({rung, first, last});
    }
  }

  // Rows [first, last), whose best columns lie in [low, high].
  void halve(std::size_t first, std::size_t last, std::size_t low, std::size_t high) {
    const std::size_t middle = first + (last - first) / 2;
    const Row& row = rows_[middle];
    const double below = stacks_.below[row.rung];
    std::size_t best = low;
    double least = kFar;
    for (std::size_t i = std::max(row.first, low); i <= std::min(row.last - 1, high); ++i) {
      const std::uint32_t up = columns_[i];
      const double value = steps_[up] + (up - row.rung) * (stacks_.below[up] - below);
      if (value > least) continue;  // of equal ones the thickest
      least = value;
      best = i;
    }
    steps_[row.rung] = least;
    via_[row.rung] = columns_[best];
    if (first < middle) halve(first, middle, low, best);
    if (middle + 1 < last) halve(middle + 1, last, best, high);
  }

  const Stacks& stacks_;
  Buffer<double> steps_;  // mm2 times rungs, from a rung to the end
  Buffer<std::uint32_t> via_;
  Buffer<std::uint32_t> rungs_, begin_;  // rungs by number of layers below them, with the offset of each number
  Buffer<std::uint32_t> columns_;        // rungs of one layer more from which the end is reached
  Buffer<Row> rows_;
};

}  // namespace

Buffer<std::uint32_t> least_steps(const Stacks& stacks) { return Search(stacks).all(); }

}  // namespace lamina::heights
