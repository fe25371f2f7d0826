// What solids hold together is computed once for all that are alike, and not at all where their part is no more what it was.

#include <gtest/gtest.h>

#include "stages/checks/solid_checks.h"

namespace lamina::checks {
namespace {

/// Many instances of two meshes; group by group.
struct Plate {
  std::vector<Mesh> meshes = std::vector<Mesh>(2);
  std::vector<Instance> instances;
  std::vector<Solid> solids;
  int volumes = 0, loads = 0;

  Plate() { meshes[0].fingerprint = 7, meshes[1].fingerprint = 8; }
  void add(std::uint32_t group, std::uint32_t mesh, Point3 at) {
    instances.push_back({mesh, at});
    solids.push_back({{at, {at.x + 1, at.y + 1, at.z + 1}}, 0, group, 1000, true});
  }
  GroupUnion::Volume counted() {
    return [this](std::span<const Mesh>, std::span<const Instance> members) -> Result<double> {
      return ++volumes, 100.0 * static_cast<double>(members.size());
    };
  }
  GroupUnion::Again reread(std::vector<Mesh> now) {
    return [this, now] { return ++loads, Result<std::vector<Mesh>>(now); };
  }
};

TEST(GroupUnion, CopiesCostAsMuchAsOne) {
  Plate plate;
  for (Nm i = 0; i < 1000; ++i) plate.add(static_cast<std::uint32_t>(i), 0, {i * 10, i, 0});
  GroupUnion merged(plate.meshes, plate.instances, plate.solids, plate.counted(), plate.reread(plate.meshes));
  EXPECT_EQ(plate.loads, 0) << "nothing was requested";
  for (std::uint32_t group = 0; group < 1000; ++group) EXPECT_EQ(*merged.mm3(group), 100);
  EXPECT_EQ(plate.volumes, 1);
  EXPECT_EQ(plate.loads, 1);
}

TEST(GroupUnion, GroupsAreAlikeIfTheirSolidsAreArrangedAlike) {
  Plate plate;
  plate.add(0, 0, {0, 0, 0}), plate.add(0, 1, {5, 0, 0});
  plate.add(1, 1, {105, 9, 3}), plate.add(1, 0, {100, 9, 3});  // moved, in another order
  plate.add(2, 0, {200, 0, 0}), plate.add(2, 1, {206, 0, 0});  // further apart
  plate.add(3, 0, {300, 0, 0}), plate.add(3, 0, {305, 0, 0});  // of one mesh
  plate.add(4, 1, {400, 0, 0});
  GroupUnion merged(plate.meshes, plate.instances, plate.solids, plate.counted());
  const int computed[] = {1, 1, 2, 3, 4};
  for (std::uint32_t group = 0; group < 5; ++group) {
    EXPECT_EQ(*merged.mm3(group), group == 4 ? 100 : 200);
    EXPECT_EQ(plate.volumes, computed[group]) << group;
  }
}

TEST(GroupUnion, APartThatHasChangedHoldsNothingKnown) {
  Plate plate;
  plate.add(0, 0, {0, 0, 0}), plate.add(1, 1, {5, 0, 0});
  std::vector<Mesh> now = plate.meshes;
  now[1].fingerprint = 9;
  GroupUnion merged(plate.meshes, plate.instances, plate.solids, plate.counted(), plate.reread(now));
  EXPECT_TRUE(merged.mm3(0).ok());
  ASSERT_FALSE(merged.mm3(1).ok());
  EXPECT_EQ(merged.mm3(1).error().fault, Fault::kInput);
  now.pop_back();
  GroupUnion fewer(plate.meshes, plate.instances, plate.solids, plate.counted(), plate.reread(now));
  EXPECT_FALSE(fewer.mm3(0).ok());
}

TEST(GroupUnion, APartThatIsGoneGivesNoWarningAndAStopIsPassedOn) {
  for (const Fault fault : {Fault::kInput, Fault::kUsage, Fault::kInternal, Fault::kInterrupted, Fault::kMemory}) {
    Plate plate;
    plate.add(0, 0, {0, 0, 0}), plate.add(1, 0, {5, 0, 0});
    GroupUnion merged(plate.meshes, plate.instances, plate.solids, plate.counted(), [&]() -> Result<std::vector<Mesh>> {
      return ++plate.loads, Error{fault, "a.stl"};
    });
    Tally tally(plate.solids);
    for (const std::uint32_t group : {0u, 1u}) tally.add_area(group, {0, 0, 1'000'000}, 100);  // of 1000
    const std::vector<std::string> names = {"a.stl"};
    Sampling sampling;
    sampling.part = names;
    sampling.thickest_mm = 0.1;
    sampling.union_mm3 = [&](std::uint32_t group) { return merged.mm3(group); };
    std::vector<Warning> warnings;
    const Status status = check_solids(tally, sampling, warnings);
    EXPECT_TRUE(warnings.empty());
    const bool stops = fault == Fault::kInterrupted || fault == Fault::kMemory;
    EXPECT_EQ(status.ok(), !stops);
    if (stops) {
      EXPECT_EQ(status.error().fault, fault);
    }
    EXPECT_EQ(plate.loads, 1);
  }
}

}  // namespace
}  // namespace lamina::checks
