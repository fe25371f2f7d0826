// tests/stokes/test_patterns.cpp: what patterns of lines do to the permeability along z has the published signs and order.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/pores/boxes.h"
#include "tests/stokes/flow_through.h"

namespace lamina {
namespace {

/// Lines of crossed layers, in voxels of the flow; beads are as high as layers and have round ends.
struct Lines {
  std::uint32_t gap = 8, group = 1, stagger = 0;
  static constexpr std::uint32_t kWidth = 8, kHigh = 6, kCutInto = 3;

  /// Gaps grow with the group, so that the porosity stays.
  std::uint32_t period() const { return group * (kWidth + gap); }
  bool solid(double x, double y, double z) const {
    const int layer = static_cast<int>(z / kHigh);
    const double across = std::fmod((layer % 2 == 0 ? x : y) + period() - (layer / 2 == 1 ? stagger : 0), period());
    const double along_bead = std::fmod(across, kWidth) - kWidth / 2.0, up = z - (layer + 0.5) * kHigh;
    const double beyond = std::max(0.0, std::abs(along_bead) - (kWidth - kHigh) / 2.0);
    return across < group * kWidth && std::hypot(beyond, up) < kHigh / 2.0;
  }
  VoxelStack box() const {
    const std::uint32_t side = kCutInto * period(), high = kCutInto * kHigh * (stagger > 0 ? 4 : 2);
    const auto middle = [](std::uint32_t i) { return (i + 0.5) / kCutInto; };
    return pores::testing::stack_of(pores::testing::Voxels(side, side, high).fill([&](auto x, auto y, auto z) {
      return solid(middle(x), middle(y), middle(z));
    }),
                                    {true, true, true});
  }
};

double along_z(const Lines& lines) { return test::flow_through(lines.box(), 2, 1e-3, 4, Lines::kCutInto).permeability[2]; }

/// M. M. A. Di Nisio (2022), section 2.5, reports of others: stagger lowers the permeability by 57 % (A. Entezari 2019) and 18
/// % (Walejewska 2019), groups of two raise it by 160 % and, with the largest stagger, lower it by up to 76 % (Shigueoka 2019).
TEST(Patterns, StaggerLowersAndGroupsRaiseThePermeability) {
  const Lines lines, staggered{.stagger = 8}, groups{.group = 2}, both{.group = 2, .stagger = 16};
  EXPECT_EQ(set_voxels(groups.box()), 4 * set_voxels(lines.box())) << "the same porosity";
  const double k = along_z(lines), stagger = along_z(staggered) / k, group = along_z(groups) / k, maximum = along_z(both) / k;
  EXPECT_LT(stagger, 1 - 0.18);
  EXPECT_GT(stagger, 1 - 0.57);
  EXPECT_NEAR(group, 1 + 1.6, 0.5);
  EXPECT_NEAR(maximum / group, 1 - 0.76, 0.1) << "against groups that stand upon each other";
  EXPECT_LT(maximum, stagger) << "and lower than single lines staggered";
}

/// The strongest parameter of all (the same section).
TEST(Patterns, TheGapIsTheStrongestParameter) {
  const double k = along_z({}), half = along_z({.gap = 4}), twice = along_z({.gap = 16});
  EXPECT_LT(half / k, along_z({.stagger = 8}) / k);
  EXPECT_GT(twice / k, along_z({.group = 2}) / k);
}

}  // namespace
}  // namespace lamina
