// tests/arrange/test_openings.cpp: where squares are free on a bed, against all of their cells.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "stages/arrange/openings.h"

namespace lamina::test {
namespace {

using arrange::BitShape;

bool has_space(const BitShape& taken, std::uint32_t x, std::uint32_t y, std::uint32_t size) {
  if (x + size > taken.width || y + size > taken.depth) return false;
  for (std::uint32_t v = 0; v < size; ++v)
    for (std::uint32_t u = 0; u < size; ++u)
      if (taken.at(x + u, y + v)) return false;
  return true;
}

TEST(Openings, AreWhereAllCellsOfASquareAreFree) {
  std::mt19937 random(11);
  const auto below = [&](std::uint32_t limit) { return static_cast<std::uint32_t>(random() % limit); };
  BitShape taken(130, 70);
  arrange::Openings openings(taken);
  constexpr std::uint32_t kSizes[] = {1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96};
  for (int step = 0; step < 60; ++step) {
    const std::uint32_t y = below(70), begin = below(130), end = std::min(130u, begin + 1 + below(9));
    openings.take(y, begin, end);
    taken.set(y, begin, end);
    if (step % 3 != 0) continue;  // several rows change between two requests
    const std::uint32_t size = kSizes[below(13)];
    const BitShape& blocked = openings.blocked_for(size + (size == 4 || size == 8 ? 1 : 0));
    for (std::uint32_t v = 0; v < 70; ++v)
      for (std::uint32_t u = 0; u < 130; ++u)
        ASSERT_EQ(!blocked.at(u, v), has_space(taken, u, v, size)) << u << " " << v << " " << size;
  }
}

}  // namespace
}  // namespace lamina::test
