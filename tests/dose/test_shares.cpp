// Images of fill fractions compared with images of pixels, each pixel computed by itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "pipeline/report/image_text.h"
#include "stages/data/grid.h"
#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/dose/field.h"
#include "stages/dose/layer_drops.h"
#include "stages/dose/saturation.h"
#include "stages/dose/shares.h"
#include "tests/program/machines.h"

namespace lamina::dose {
namespace {

constexpr std::uint32_t kWide = 41, kHigh = 23;

/// A byte a pixel: what the runs say, read back.
std::vector<int> share_pixels(const LevelsView& image) {
  std::vector<int> pixels(std::size_t{image.columns} * image.rows(), 0);
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    for (std::uint32_t i = image.row_offset[r]; i < image.row_offset[r + 1]; ++i) {
      for (std::uint32_t c = image.change[2 * i]; c < image.change[2 * i + 1]; ++c) {
        pixels[std::size_t{r} * image.columns + c] = image.level[i];
      }
    }
  }
  return pixels;
}
std::vector<int> share_pixels(const RunsView& image) {
  Levels levels;
  levels_of(image, 1, levels);
  return share_pixels(levels.view());
}

Levels random_shares(std::uint32_t seed, std::uint32_t full) {
  program::testing::Random random(seed);
  Levels levels;
  levels.start(kWide);
  for (std::uint32_t r = 0; r < kHigh; ++r) {
    for (std::uint32_t c = 0; c < kWide;) {
      const std::uint32_t end = std::min(kWide, c + 1 + random() % 6);
      levels.append(c, end, static_cast<std::uint8_t>(random() % (full + 1)));
      c = end;
    }
    levels.end_row();
  }
  return levels;
}

Runs random_mask(std::uint32_t seed) {
  Runs mask;
  threshold_levels(random_shares(seed, 2), 1, mask);
  return mask;
}

TEST(Shares, AreTurnedMaskedAndMarkedPixelByPixel) {
  for (std::uint32_t seed = 1; seed < 20; ++seed) {
    const Levels image = random_shares(seed, 15);
    const Runs mask = random_mask(seed + 100);
    const std::vector<int> before = share_pixels(image.view()), set = share_pixels(mask.view());
    Levels masked, marked, turned;
    without(image, mask, masked);
    mark_core(image, mask, 15, marked);
    const std::vector<int> outside = share_pixels(masked.view()), in_core = share_pixels(marked.view());
    for (std::size_t i = 0; i < before.size(); ++i) {
      ASSERT_EQ(outside[i], set[i] != 0 ? 0 : before[i]);
      ASSERT_EQ(in_core[i], before[i] + (set[i] != 0 && before[i] > 0 ? 15 : 0));
    }
    for (const auto& [x, y] : {std::pair{true, false}, {false, true}, {true, true}}) {
      mirror(image, x, y, turned);
      const std::vector<int> after = share_pixels(turned.view());
      for (std::uint32_t r = 0; r < kHigh; ++r) {
        for (std::uint32_t c = 0; c < kWide; ++c) {
          ASSERT_EQ(after[r * kWide + c], before[(y ? kHigh - 1 - r : r) * kWide + (x ? kWide - 1 - c : c)]);
        }
      }
    }
  }
}

TEST(Shares, DifferencesAreCountedAndThoseWithoutABoundaryNextToThem) {
  for (std::uint32_t seed = 1; seed < 20; ++seed) {
    const Runs a = random_mask(seed), b = random_mask(seed + 50);
    const std::vector<int> one = share_pixels(a.view()), other = share_pixels(b.view());
    const auto at = [&](std::int64_t c, std::int64_t r) {
      return c < 0 || r < 0 || c >= kWide || r >= kHigh ? 0 : one[static_cast<std::size_t>(r * kWide + c)];
    };
    std::uint64_t pixels = 0, far = 0;
    for (std::int64_t r = 0; r < kHigh; ++r) {
      for (std::int64_t c = 0; c < kWide; ++c) {
        const std::size_t i = static_cast<std::size_t>(r * kWide + c);
        if (one[i] == other[i]) continue;
        ++pixels;
        bool alike = true;
        for (std::int64_t k = 0; k < 9; ++k) alike = alike && at(c + k % 3 - 1, r + k / 3 - 1) == one[i];
        far += alike ? 1 : 0;
      }
    }
    const Difference found = difference(a, b);
    ASSERT_EQ(found.pixels, pixels);
    ASSERT_EQ(found.far, far);
  }
  const Runs empty{5, {0, 0, 0, 0}, {}}, square{5, {0, 2, 4, 6}, {0, 5, 0, 5, 0, 5}};
  EXPECT_EQ(difference(empty, square).far, 15u);
  EXPECT_EQ(difference(square, empty).far, 3u);  // its own edge is a boundary, that of the image too
}

// Levels 0 to 3 of a full voxel's 3.5 drops are 0, 1.1667, 2.3333 and 3.5: rounded 0, 1, 2, 4.
TEST(Shares, BecomeDropsInProportionOrRounded) {
  LayerDose dose = one_drop();
  dose.shell = dose.core = dose.requested_shell = dose.requested_inside = 7 * kOneDrop / 2;
  const std::vector<int> rounded{0, 1, 2, 4};
  for (const bool dithered : {true, false}) {
    DropWork work;
    work.shares = random_shares(3, 3);
    const std::vector<int> levels = share_pixels(work.shares.view());
    Runs image, second;
    image.columns = second.columns = kWide;
    take_half(3, image = random_mask(9), second, work);
    const std::vector<int> half = share_pixels(image.view());
    const ZoneSums sums = drops_of_layer({3, dithered, {}, 4}, dose, 5, image, second, work);
    Levels of_pixels;
    Runs plane;
    levels_of(work.drops[0], of_pixels);
    runs_of(work.drops[0], 0, plane);
    const std::vector<int> drops = share_pixels(of_pixels.view()), first = share_pixels(plane.view());
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < levels.size(); ++i) {
      sum += static_cast<std::uint64_t>(levels[i]);
      ASSERT_EQ(half[i], levels[i] >= 2 ? 1 : 0);
      ASSERT_EQ(first[i], drops[i] > 0 ? 1 : 0);
      const double requested_range = 3.5 * levels[i] / 3;
      if (dithered) {
        ASSERT_TRUE(drops[i] == static_cast<int>(requested_range) || drops[i] == static_cast<int>(requested_range) + 1);
      } else {
        ASSERT_EQ(drops[i], rounded[static_cast<std::size_t>(levels[i])]);
      }
    }
    EXPECT_EQ(sums.full_voxels, (2 * sum + 3) / 6);
    EXPECT_EQ(sums.requested_drops, (7 * sum + 3) / 6);
  }
}

TEST(Shares, SurplusAndMaskAreThoseOfEachPixel) {
  for (std::uint32_t seed = 1; seed <= 40; ++seed) {
    const Levels some = random_shares(seed, 5), more = random_shares(1000 + seed, 3);
    const Runs mask = random_mask(500 + seed);
    const std::vector<int> a = share_pixels(some.view()), b = share_pixels(more.view()), m = share_pixels(mask.view());
    Levels all;  // the sum, made pixel by pixel
    all.start(kWide);
    for (std::uint32_t r = 0; r < kHigh; ++r) {
      for (std::uint32_t c = 0; c < kWide; ++c) {
        const std::size_t p = std::size_t{r} * kWide + c;
        all.append(c, c + 1, static_cast<std::uint8_t>(a[p] + b[p]));
      }
      all.end_row();
    }
    Levels surplus_of, kept;
    surplus(all, some, surplus_of);
    EXPECT_EQ(share_pixels(surplus_of.view()), b) << seed;
    within(all, mask, kept);
    const std::vector<int> inside = share_pixels(kept.view());
    for (std::size_t p = 0; p < inside.size(); ++p) EXPECT_EQ(inside[p], m[p] * (a[p] + b[p])) << seed;
  }
}

/// Random parts of three materials that share voxels, and the request of a full voxel of each.
void add_random_parts(std::uint32_t seed, std::uint8_t full, DropWork& work) {
  work.deposited.clear();
  for (std::uint32_t i = 0; i < 5; ++i) work.deposited.push_back({random_shares(100 * seed + i, full), {}, i % 2, (i * 2) % 3});
  share_out(full, kWide, kHigh, work);
}

// Each pixel's drops are those of its materials; a material has what it would have in the parts up to it.
TEST(Shares, DropsOfMaterialsAddUpAndAreNested) {
  constexpr std::uint8_t kFull = 15;
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    for (const bool dithered : {true, false}) {
      DropWork work;
      add_random_parts(seed, kFull, work);
      const Sheet sheet{
          PixelGrid{PixelAxis(254, kWide * 100'000), PixelAxis(254, kHigh * 100'000)}, false, false, {seed, 0, 100'000}};
      ASSERT_EQ(sheet.grid.columns(), kWide);
      const DropRules rules{kFull, dithered, {}, 4};
      Sheet limited = sheet;
      limited.dithered = dithered;
      limited.limit = Drops24{4} << kDropBits;
      const std::vector<std::array<DropRequest, 2>> requests{{DropRequest{kOneDrop * 7 / 2}, DropRequest{kOneDrop * 7 / 2}},
                                                             {DropRequest{kOneDrop * 2}, DropRequest{kOneDrop * 2}}};
      Runs image, second;
      ASSERT_TRUE(drops_of_deposited(rules, limited, requests, 3, image, second, work).ok());
      ASSERT_EQ(work.drops.size(), 4u);
      std::vector<int> sum(std::size_t{kWide} * kHigh, 0);
      for (std::size_t m = 0; m < 3; ++m) {
        Levels of_pixels;
        levels_of(work.drops[1 + m], of_pixels);
        const std::vector<int> drops = share_pixels(of_pixels.view());
        for (std::uint32_t k = 0; k < 4; ++k) {
          Runs own;
          runs_of(work.drops[1 + m], k, own);
          const std::vector<int> plane = share_pixels(own.view());
          for (std::size_t p = 0; p < plane.size(); ++p) EXPECT_EQ(plane[p], drops[p] > static_cast<int>(k) ? 1 : 0);
        }
        for (std::size_t p = 0; p < sum.size(); ++p) sum[p] += drops[p];
      }
      EXPECT_EQ(sum, share_pixels(work.levels.view())) << seed;
    }
  }
}

// Upper parts take from lower ones; the result of depositing one by one is that of depositing at once.
TEST(Shares, DepositedOneByOneAreThoseDepositedAtOnce) {
  for (std::uint32_t seed = 1; seed <= 30; ++seed) {
    DropWork at_once, one_by_one;
    std::vector<Levels> parts;
    for (std::uint32_t i = 0; i < 5; ++i) parts.push_back(random_shares(100 * seed + i, 15));
    share_out(15, kWide, kHigh, one_by_one);
    EXPECT_EQ(one_by_one.shares.level.size(), 0u);
    for (const Levels& part : parts) {
      at_once.deposited.push_back({part, {}, 0, 0});
      one_by_one.deposited.push_back({part, {}, 0, 0});
      share_out(15, kWide, kHigh, one_by_one);
    }
    share_out(15, kWide, kHigh, at_once);
    EXPECT_EQ(share_pixels(at_once.shares.view()), share_pixels(one_by_one.shares.view()));
    for (std::size_t i = 0; i < parts.size(); ++i) {
      EXPECT_EQ(share_pixels(at_once.deposited[i].shares.view()), share_pixels(one_by_one.deposited[i].shares.view())) << seed;
    }
  }
}

TEST(Shares, AreReportedInOneLine) {
  ShareCount count;
  count.add(150, 2, 0);
  count.add(50, 1, 1);
  EXPECT_EQ(pipeline::voxels_text(count, 16, "grey"),
            "16 levels come to 200 full voxels, as grey; 3 (1.500 %) half full or more are not as their centre, 1 away from "
            "any boundary");
}

}  // namespace
}  // namespace lamina::dose
