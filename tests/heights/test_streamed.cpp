// Layers that are decided one by one are those that are decided at once, and none changes once it is decided.
#include <gtest/gtest.h>

#include <array>
#include <random>

#include "stages/heights/greedy.h"
#include "tests/heights/surfaces.h"

namespace lamina::heights {
namespace {

/// Slopes, steps and horizontal faces up to a height.
Mesh random_hill(std::mt19937& random) {
  std::vector<std::pair<double, double>> profile{{0, 0}};
  const std::uint32_t corners = 3 + static_cast<std::uint32_t>(random()) % 12;
  for (std::uint32_t i = 0; i < corners; ++i) {
    const auto [x, z] = profile.back();
    const double width = random() % 4 == 0 ? 0 : 0.01 * static_cast<double>(random() % 200);
    const double rise = random() % 4 == 0 ? 0 : 0.001 * static_cast<double>(random() % 900);
    profile.push_back({x + width + 0.01, z + rise});
  }
  return test::strip(profile);
}

void expect_equal(const Layer& one, const Layer& other) {
  EXPECT_EQ(one.index, other.index);
  EXPECT_EQ(one.bottom, other.bottom);
  EXPECT_EQ(one.thickness, other.thickness);
  EXPECT_EQ(one.reason, other.reason);
}

void expect_equal(const Plan& streamed, const Plan& whole) {
  ASSERT_EQ(streamed.table.size(), whole.table.size());
  for (std::uint32_t i = 0; i < whole.table.size(); ++i) expect_equal(streamed.table[i], whole.table[i]);
  EXPECT_EQ(streamed.inspected, whole.inspected);
  EXPECT_EQ(streamed.stepped_back, whole.stepped_back);
  EXPECT_EQ(streamed.small_peaks, whole.small_peaks);
}

TEST(StreamedHeights, AreThoseDecidedAtOnce) {
  std::mt19937 random(11);
  for (int turn = 0; turn < 600; ++turn) {
    const SurfaceIndex index = test::index_of(random_hill(random));
    Options options;
    options.mode = std::array{Mode::kAngle, Mode::kCusp, Mode::kStepwise}[static_cast<std::size_t>(turn % 3)];
    options.set = turn % 2 == 0 ? test::set_of({0.05, 0.1, 0.27}) : test::range_of(0.05, 0.3, 0.01);
    options.facets = turn % 5 == 0 ? Facets::kPlane : Facets::kRange;
    options.cover_top = turn % 7 < 3;
    const Result<Plan> whole = plan_heights(index, options);
    ASSERT_TRUE(whole.ok()) << whole.error().message;

    Plan streamed;
    auto layers = begin_heights(index, options, streamed);
    ASSERT_TRUE(layers.ok());
    EXPECT_LE(whole->table.size(), (*layers)->max_layers());
    std::vector<Layer> decided;
    while ((*layers)->decide(static_cast<std::uint32_t>(decided.size()), streamed)) {
      decided.push_back(streamed.table[static_cast<std::uint32_t>(decided.size())]);
    }
    expect_equal(streamed, *whole);
    ASSERT_EQ(decided.size(), whole->table.size());
    for (std::uint32_t i = 0; i < decided.size(); ++i) expect_equal(decided[i], whole->table[i]);
    EXPECT_FALSE((*layers)->decide(static_cast<std::uint32_t>(decided.size()), streamed)) << "it stays complete";
  }
}

TEST(StreamedHeights, EntriesKeepTheirAddresses) {
  const SurfaceIndex index = test::index_of(test::strip({{0, 0}, {4, 2}, {4, 9}}));
  Options options;
  options.mode = Mode::kCusp;
  options.set = test::range_of(0.05, 0.3, 0.01);
  options.cusp = test::nm(0.02);
  Plan plan;
  auto layers = begin_heights(index, options, plan);
  ASSERT_TRUE(layers.ok());
  ASSERT_TRUE((*layers)->decide(0, plan));
  const std::size_t capacity = plan.table.capacity();
  while ((*layers)->advance(plan)) {
  }
  EXPECT_EQ(plan.table.capacity(), capacity);
  EXPECT_GT(plan.table.size(), 30u);
}

}  // namespace
}  // namespace lamina::heights
