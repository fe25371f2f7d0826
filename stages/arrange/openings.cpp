#include "stages/arrange/openings.h"

#include <algorithm>

namespace lamina::arrange {
namespace {

constexpr std::uint64_t kFull = ~std::uint64_t{0};

/// out |= the union of a row and the row read `by` cells ahead; beyond the row all is blocked.
void add_pair(std::span<const std::uint64_t> in, std::uint32_t by, std::span<std::uint64_t> out) {
  const std::size_t words = by / 64, bits = by % 64;
  const auto word = [&](std::size_t w) { return w < in.size() ? in[w] : kFull; };
  for (std::size_t w = 0; w < out.size(); ++w) {
    std::uint64_t ahead = word(w + words) >> bits;
    if (bits > 0) ahead |= word(w + words + 1) << (64 - bits);
    out[w] |= in[w] | ahead;
  }
}

}  // namespace

Openings::Openings(const BitShape& taken) {
  for (std::size_t i = 0; i < kSizes.size(); ++i) {
    maps_[i].blocked = i == 0 ? taken : BitShape(taken.width, taken.depth);
    maps_[i].to = taken.depth;
  }
  // Cells of the last words that are not on the bed.
  if (taken.width % 64 == 0) return;
  for (std::uint32_t y = 0; y < taken.depth; ++y) maps_[0].blocked.row(y).back() |= kFull << (taken.width % 64);
}

void Openings::take(std::uint32_t y, std::uint32_t begin, std::uint32_t end) {
  maps_[0].blocked.set(y, begin, end);
  for (std::size_t i = 1; i < kSizes.size(); ++i) {
    SquareMap& map = maps_[i];
    const std::uint32_t from = y + 1 - std::min(y + 1, kSizes[i]);
    const bool none = map.from >= map.to;
    map.from = none ? from : std::min(map.from, from);
    map.to = none ? y + 1 : std::max(map.to, y + 1);
  }
}

void Openings::refresh(std::size_t number) {
  if (number == 0 || maps_[number].from >= maps_[number].to) return;
  refresh(number - 1);
  SquareMap& map = maps_[number];
  const BitShape& smaller = maps_[number - 1].blocked;
  const std::uint32_t by = kSizes[number] - kSizes[number - 1];  // two of the smaller squares along each side cover it
  for (std::uint32_t y = map.from; y < map.to; ++y) {
    const std::span<std::uint64_t> row = map.blocked.row(y);
    if (y + by >= smaller.depth) {
      std::ranges::fill(row, kFull);
      continue;
    }
    std::ranges::fill(row, 0);
    add_pair(smaller.row(y), by, row);
    add_pair(smaller.row(y + by), by, row);
  }
  map.from = map.to = 0;
}

const BitShape& Openings::blocked_for(std::uint32_t square) {
  const auto above = std::ranges::upper_bound(kSizes, square);
  const auto number = static_cast<std::size_t>(above - kSizes.begin()) - 1;
  refresh(number);
  return maps_[number].blocked;
}

}  // namespace lamina::arrange
