// Bodies and pieces on runs against a flood of voxels.
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <random>
#include <vector>

#include "stages/checks/bodies.h"
#include "tests/checks/volume.h"

namespace lamina::checks {
namespace {

Volume random_volume(std::uint32_t seed, double share) {
  Volume volume{23, 17, 9, {}};
  std::mt19937 random(seed);
  volume.set.resize(23 * 17 * 9);
  for (auto& voxel : volume.set) voxel = std::uniform_real_distribution<>(0, 1)(random) < share;
  return volume;
}

/// Sizes of bodies by flooding voxels, largest first.
std::vector<std::uint64_t> flood(const Volume& volume, bool diagonal) {
  std::vector<std::uint8_t> detected(volume.set.size(), 0);
  std::vector<std::uint64_t> sizes;
  for (std::size_t start = 0; start < detected.size(); ++start) {
    if (detected[start] != 0 || volume.set[start] == 0) continue;
    std::vector<std::size_t> open{start};
    detected[start] = 1;
    std::uint64_t size = 0;
    while (!open.empty()) {
      const std::size_t at = open.back();
      open.pop_back();
      ++size;
      const auto c = static_cast<std::int64_t>(at % volume.columns),
                 r = static_cast<std::int64_t>(at / volume.columns % volume.rows),
                 l = static_cast<std::int64_t>(at / volume.columns / volume.rows);
      for (std::int64_t dl = -1; dl <= 1; ++dl) {
        for (std::int64_t dr = -1; dr <= 1; ++dr) {
          for (std::int64_t dc = -1; dc <= 1; ++dc) {
            const auto steps = std::abs(dc) + std::abs(dr);
            if (dl != 0 ? steps != 0 : steps > (diagonal ? 2 : 1)) continue;
            if (!volume.at(c + dc, r + dr, l + dl)) continue;
            const auto next = static_cast<std::size_t>(((l + dl) * volume.rows + r + dr) * volume.columns + c + dc);
            if (detected[next] != 0) continue;
            detected[next] = 1;
            open.push_back(next);
          }
        }
      }
    }
    sizes.push_back(size);
  }
  std::sort(sizes.rbegin(), sizes.rend());
  return sizes;
}

struct Count {
  std::vector<std::uint64_t> sizes;
  std::uint32_t begun = 0;
  void begin(Body&) { ++begun; }
  void grow(Body&) {}
  void join(const Body&, const Body&, const Body&) {}
  void end(const Body& body) { sizes.push_back(body.pixels); }
};

TEST(Bodies, AreThoseOfAFloodOfVoxels) {
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    const Volume volume = random_volume(seed, 0.1 + 0.01 * seed);
    for (const bool diagonal : {false, true}) {
      Follower follower(diagonal);
      Count count;
      for (std::uint32_t l = 0; l < volume.layers; ++l) {
        const Runs image = volume.layer(l);
        follower.find(image);
        follower.add({l, static_cast<Nm>(l * 50'000), 50'000}, image, count);
        EXPECT_EQ(follower.live().size() > 0, !image.change.empty());
      }
      follower.finish(count);
      std::sort(count.sizes.rbegin(), count.sizes.rend());
      ASSERT_EQ(count.sizes, flood(volume, diagonal)) << seed;
      EXPECT_GE(count.begun, count.sizes.size());
    }
  }
}

TEST(Bodies, BoxesHeightsAndVolumesAreThoseOfTheirVoxels) {
  // An arch: two feet, joined by a lintel in the third layer.
  Volume arch{12, 5, 3, std::vector<std::uint8_t>(12 * 5 * 3, 0)};
  const auto set = [&](std::uint32_t c, std::uint32_t r, std::uint32_t l) { arch.set[(l * 5 + r) * 12 + c] = 1; };
  for (std::uint32_t l = 0; l < 2; ++l) set(2, 2, l), set(9, 2, l);
  for (std::uint32_t c = 2; c < 10; ++c) set(c, 2, 2);
  struct Rules : Count {
    std::uint32_t joined = 0;
    Body last;
    void join(const Body& stays, const Body& ends, const Body& piece) {
      ++joined;
      EXPECT_EQ(stays.pixels + ends.pixels, 2u + 8 + 2);  // a foot with the lintel, the other foot
      EXPECT_EQ(piece.box.right, 10u);
    }
    void end(const Body& body) { last = body; }
  } rules;
  Follower follower(true);
  for (std::uint32_t l = 0; l < 3; ++l) {
    const Runs image = arch.layer(l);
    follower.find(image);
    follower.add({l, static_cast<Nm>(l * 100), 100}, image, rules);
  }
  follower.finish(rules);
  EXPECT_EQ(rules.begun, 2u);
  EXPECT_EQ(rules.joined, 1u);
  EXPECT_EQ(rules.last.pixels, 12u);
  EXPECT_EQ(rules.last.pixel_nm, 1200u);
  EXPECT_EQ(rules.last.bottom, 0);
  EXPECT_EQ(rules.last.top, 300);
  EXPECT_EQ(rules.last.first_layer, 0u);
  EXPECT_EQ(rules.last.last_layer, 2u);
  EXPECT_EQ(rules.last.box.left, 2u);
  EXPECT_EQ(rules.last.box.right, 10u);
}

}  // namespace
}  // namespace lamina::checks
