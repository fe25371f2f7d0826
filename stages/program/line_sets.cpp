#include "stages/program/line_sets.h"

#include <algorithm>

namespace lamina::program {

void combine(ColumnChanges one, ColumnChanges other, LineOperation operation, Buffer<std::uint32_t>& result) {
  std::size_t i = 0, j = 0;
  bool before = false;
  while (i < one.size() || j < other.size()) {
    const std::uint32_t a = i < one.size() ? one[i] : UINT32_MAX, b = j < other.size() ? other[j] : UINT32_MAX;
    const std::uint32_t at = a < b ? a : b;
    i += a == at;
    j += b == at;
    const bool in_one = i % 2 == 1, in_other = j % 2 == 1;
    const bool inside = operation == LineOperation::kUnion ? in_one || in_other : in_one && !in_other;
    if (inside != before) result.push_back(at);
    before = inside;
  }
}

std::uint64_t pixels_of(ColumnChanges line) {
  std::uint64_t pixels = 0;
  for (std::size_t i = 0; i + 1 < line.size(); i += 2) pixels += line[i + 1] - line[i];
  return pixels;
}

void divide(ColumnChanges line, std::uint64_t number, std::uint32_t share, bool upper, Buffer<std::uint32_t>& result) {
  for (std::size_t i = 0; i + 1 < line.size(); i += 2) {
    bool before = false;
    for (std::uint32_t position = line[i]; position < line[i + 1]; ++position) {
      const bool fires = upper_fires(number, position, share) == upper;
      if (fires != before) result.push_back(position);
      before = fires;
    }
    if (before) result.push_back(line[i + 1]);
  }
}

void DropBits::begin(std::uint32_t bits) {
  bits_ = bits;
  for (std::uint32_t bit = 0; bit < bits; ++bit) {
    change_[bit].clear();
    end_[bit].clear();
  }
}

void DropBits::add(std::span<const ColumnChanges> drops) {
  next_.assign(drops.size(), 0);
  std::uint32_t before = 0;
  for (;;) {
    std::uint32_t at = UINT32_MAX, number = 0;
    for (std::size_t k = 0; k < drops.size(); ++k) {
      if (next_[k] < drops[k].size()) at = std::min(at, drops[k][next_[k]]);
    }
    if (at == UINT32_MAX) break;
    for (std::size_t k = 0; k < drops.size(); ++k) {
      next_[k] += next_[k] < drops[k].size() && drops[k][next_[k]] == at;
      number += static_cast<std::uint32_t>(next_[k] % 2);
    }
    for (std::uint32_t bit = 0; bit < bits_; ++bit) {
      if (((number ^ before) >> bit & 1) != 0) change_[bit].push_back(at);
    }
    before = number;
  }
  for (std::uint32_t bit = 0; bit < bits_; ++bit) end_[bit].push_back(static_cast<std::uint32_t>(change_[bit].size()));
}

void DropBits::end(std::span<ColumnChanges> nozzle) const {
  for (std::uint32_t bit = 0; bit < bits_; ++bit) {
    const ColumnChanges all(change_[bit].data(), change_[bit].size());
    const std::size_t nozzles = end_[bit].size();
    std::uint32_t begin = 0;
    for (std::size_t i = 0; i < nozzles; ++i) {
      nozzle[bit * nozzles + i] = all.subspan(begin, end_[bit][i] - begin);
      begin = end_[bit][i];
    }
  }
}

std::uint64_t DropBits::bytes() const {
  std::uint64_t total = 0;
  for (std::uint32_t bit = 0; bit < kMax; ++bit) total += bytes_held(change_[bit]) + bytes_held(end_[bit]);
  return total;
}

}  // namespace lamina::program
