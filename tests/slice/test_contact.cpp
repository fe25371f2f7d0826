// tests/slice/test_contact.cpp: groups of contours in contact, against all pairs of edges.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "stages/geometry/contours/contact.h"
#include "stages/geometry/contours/simplify.h"

namespace lamina::test {
namespace {

/// Group of each contour by comparing every edge with every other.
std::vector<std::uint32_t> groups_of(const Contours& contours) {
  const std::uint32_t count = contours.size();
  std::vector<std::uint32_t> root(count), group(count, kNoContact);
  for (std::uint32_t c = 0; c < count; ++c) root[c] = c;
  const auto find = [&](std::uint32_t c) {
    while (root[c] != c) c = root[c];
    return c;
  };
  for (std::uint32_t c = 0; c < count; ++c) {
    for (std::uint32_t d = c; d < count; ++d) {
      const auto one = contours[c], other = contours[d];
      const std::size_t n = one.size(), m = other.size();
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = c == d ? i + 1 : 0; j < m; ++j) {
          if (c == d && ((i + 1) % n == j || (j + 1) % n == i)) continue;
          if (!intervals_meet(one[i], one[(i + 1) % n], other[j], other[(j + 1) % m])) continue;
          group[c] = group[d] = 0;
          const std::uint32_t a = find(c), b = find(d);
          root[std::max(a, b)] = std::min(a, b);
        }
      }
    }
  }
  for (std::uint32_t c = 0; c < count; ++c) {
    if (group[c] != kNoContact) group[c] = find(c);
  }
  return group;
}

/// A closed curve about a place; `rough` shakes its points.
void add_curve(std::mt19937& random, Nm span, double rough, Contours& out) {
  std::uniform_real_distribution<double> any(0, 1);
  const double x = any(random) * span, y = any(random) * span, radius = (0.02 + 0.2 * any(random)) * span,
               wave = 0.3 * any(random);
  const int points = 4 + static_cast<int>(any(random) * 120);
  const double turn = any(random) * 7;
  for (int k = 0; k < points; ++k) {
    const double angle = 2 * std::numbers::pi * k / points;
    const double r = radius * (1 + wave * std::sin(3 * angle + turn) + rough * (any(random) - 0.5));
    out.point.push_back(
        {static_cast<Nm>(std::llround(x + r * std::cos(angle))), static_cast<Nm>(std::llround(y + r * std::sin(angle)))});
  }
  out.close();
}

TEST(ContactGroups, AreThoseOfAllPairsOfEdgesForSmoothRoughAndTouchingContours) {
  std::mt19937 random(5);
  ContactScratch scratch;
  Buffer<std::uint32_t> group;
  int by_halving = 0, by_grid = 0, apart = 0;
  for (int turn = 0; turn < 400; ++turn) {
    Contours contours;
    const Nm span = turn % 5 == 0 ? 200 : 10'000'000;  // a grid so coarse that contours touch in points
    const double rough = turn % 3 == 0 ? 0 : turn % 3 == 1 ? 0.05 : 0.9;
    for (int c = 0; c < 1 + turn % 7; ++c) add_curve(random, span, rough, contours);
    tidy(contours);
    const bool any = find_contacts(contours, scratch, group);
    const auto expected = groups_of(contours);
    ASSERT_EQ(std::vector<std::uint32_t>(group.begin(), group.end()), expected) << "turn " << turn;
    ASSERT_EQ(any, std::ranges::any_of(expected, [](std::uint32_t g) { return g != kNoContact; }));
    (find_monotone_contacts(contours, scratch) ? by_halving : by_grid) += 1;
    apart += any ? 0 : 1;
  }
  EXPECT_GT(by_halving, 100);
  EXPECT_GT(by_grid, 100);
  EXPECT_GT(apart, 30);
}

TEST(ContactGroups, OfSeparateCopiesAreFoundByHalvingHoweverManyThereAre) {
  constexpr std::uint32_t kSide = 50;
  constexpr Nm kPitch = 2'100;
  Contours contours;
  for (std::uint32_t c = 0; c < kSide * kSide; ++c) {
    const double x = kPitch * (c % kSide), y = kPitch * (c / kSide);
    for (int k = 0; k < 40; ++k) {
      const double angle = 2 * std::numbers::pi * k / 40;
      contours.point.push_back({static_cast<Nm>(x + 1'000 * std::cos(angle)), static_cast<Nm>(y + 1'000 * std::sin(angle))});
    }
    contours.close();
  }
  for (std::uint32_t i = 40 * 7; i < 40 * 8; ++i) contours.point[i].x -= kPitch / 2;  // contour 7 meets contour 6
  ContactScratch scratch;
  ASSERT_TRUE(find_monotone_contacts(contours, scratch));
  EXPECT_EQ(scratch.region[6], scratch.region[7]);
  EXPECT_NE(scratch.region[5], scratch.region[6]);
  Buffer<std::uint32_t> group;
  EXPECT_TRUE(find_contacts(contours, scratch, group));
  for (std::uint32_t c = 0; c < contours.size(); ++c) ASSERT_EQ(group[c], c == 6 || c == 7 ? 6 : kNoContact) << c;
}

}  // namespace
}  // namespace lamina::test
