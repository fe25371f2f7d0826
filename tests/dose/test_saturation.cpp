#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/report/image_text.h"
#include "stages/dose/blue_noise.h"
#include "stages/dose/budget.h"
#include "stages/dose/dither.h"
#include "stages/dose/saturation.h"
#include "stages/dose/shares.h"
#include "stages/geometry/bits.h"
#include "stages/geometry/drop_rows.h"
#include "stages/support/hash/hash.h"
#include "tests/dose/void_and_cluster.h"
#include "tests/program/machines.h"

namespace lamina::dose {
namespace {

using program::testing::random_image;
using DoseRandom = program::testing::Random;

// Pixels of 100 um.
const PixelGrid kTenths{PixelAxis(254, 20'000'000), PixelAxis(254, 20'000'000)};

Runs full_square(std::uint32_t side) {
  Runs runs{side, {0}, {}};
  for (std::uint32_t r = 0; r < side; ++r) {
    runs.change.insert(runs.change.end(), {0, side});
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

std::vector<int> levels_by_pixel(const LevelsView& levels) {
  std::vector<int> pixels(std::size_t{levels.columns} * levels.rows(), 0);
  for (std::uint32_t r = 0; r < levels.rows(); ++r) {
    for (std::uint32_t i = levels.row_offset[r]; i < levels.row_offset[r + 1]; ++i) {
      for (std::uint32_t c = levels.change[2 * i]; c < levels.change[2 * i + 1]; ++c) {
        pixels[std::size_t{r} * levels.columns + c] = levels.level[i];
      }
    }
  }
  return pixels;
}

/// The drops of each pixel of zones that get so many.
Levels drops_of_pixels(const Levels& zones, std::span<const Drops24> drops, std::uint32_t layer) {
  DropPatterns patterns;
  make_zones(drops, layer, patterns);
  Levels levels;
  levels_of(DropImageView{zones, &patterns}, levels);
  return levels;
}

Levels dithered(const RunsView& image, Drops24 drops, std::uint32_t layer) {
  Levels zones;
  levels_of(image, 1, zones);
  const std::array<Drops24, 2> table{0, drops};
  return drops_of_pixels(zones, table, layer);
}

/// The bytes of rows that are written where they may be set, of which no span touches another.
void expect_set_bytes(const DropPlane& rows, RowBits image) {
  RowBits all(rows);
  for (std::uint32_t r = 0; r < rows.rows(); ++r) {
    std::vector<std::byte> set(row_bytes(rows.columns())), whole(set.size());
    Buffer<RowSpan> spans;
    image.put_set(r, set, spans);
    all.put(r, whole);
    EXPECT_EQ(set, whole);
    std::size_t next = 0;
    for (const RowSpan& of : spans) {
      EXPECT_LT(of.begin, of.end);
      EXPECT_TRUE(std::all_of(set.data() + next, set.data() + of.begin, [](std::byte byte) { return byte == std::byte{0}; }));
      next = of.end;
    }
    EXPECT_LE(next, set.size());
    EXPECT_TRUE(std::all_of(set.data() + next, set.data() + set.size(), [](std::byte byte) { return byte == std::byte{0}; }));
  }
}

/// Rows of words, runs and counts of a drop image, against the drops of its pixels.
void expect_rows_and_counts(const DropImageView& image, const Levels& levels, std::uint32_t maximum) {
  DropCounter counter;
  counter.start(*image.patterns);
  const DropTotals totals(image, counter);
  EXPECT_EQ(totals.drops(), sum_of_levels(levels));
  EXPECT_EQ(totals.maximum(), highest(levels));
  for (std::uint32_t drop = 0; drop < maximum; ++drop) {
    Runs plane, found{7, {0, 1}, {3}};
    threshold_levels(levels, static_cast<std::uint8_t>(drop + 1), plane);
    runs_of(image, drop, found);
    EXPECT_EQ(found.columns, plane.columns);
    EXPECT_EQ(found.row_offset, plane.row_offset);
    EXPECT_EQ(found.change, plane.change);
    EXPECT_EQ(totals.pixels(drop), set_pixels(plane));
    const DropPlane rows(image, drop);
    std::vector<std::uint64_t> words(rows.words(), 5), same(rows.words());
    for (std::uint32_t r = 0; r < rows.rows(); ++r) {
      std::ranges::fill(same, 0);
      const auto row = plane.view().row(r);
      for (std::size_t k = 0; k + 1 < row.size(); k += 2)
        set_pattern(same.data(), row[k], row[k + 1], ~std::uint64_t{0}, ~std::uint64_t{0});
      rows.row(r, words);
      EXPECT_EQ(words, same);
      std::vector<std::uint64_t> written(words.size(), 7), set(words.size(), 0);
      Buffer<RowSpan> spans;
      rows.set_words(r, written, spans);
      for (const RowSpan& of : spans) std::copy(&written[of.begin], written.data() + of.end, &set[of.begin]);
      EXPECT_EQ(set, same);
    }
    expect_set_bytes(rows, rows);
    expect_set_bytes(rows, plane.view());
  }
  for (std::uint32_t row = 0; row < image.zones.rows(); ++row) {
    for (std::size_t i = image.zones.row_offset[row]; i < image.zones.row_offset[row + 1]; ++i) {
      const std::uint32_t middle = (image.zones.change[2 * i] + image.zones.change[2 * i + 1]) / 2;
      const std::uint8_t zone = image.zones.level[i];
      EXPECT_EQ(counter.drops(zone, row, image.zones.change[2 * i], middle) +
                    counter.drops(zone, row, middle, image.zones.change[2 * i + 1]),
                counter.drops(zone, row, image.zones.change[2 * i], image.zones.change[2 * i + 1]));
    }
  }
}

std::vector<int> tile_pattern(double share, std::uint32_t layer) {
  return levels_by_pixel(dithered(full_square(kTileSide), static_cast<Drops24>(share * kOneDrop), layer));
}

// A voxel of 100 x 100 x 100 um is 1000 pl, its voids at a packing of 0.6 are 400 pl: 70 % of them are 280 pl.
TEST(Saturation, IsThatOfAHandCalculation) {
  const Binder binder{40, 0, 0.6};
  EXPECT_EQ(drops_for(70, binder, kTenths, 100'000), 7 * kOneDrop);
  EXPECT_EQ(drops_for(70, binder, kTenths, 50'000), 7 * kOneDrop / 2);
  EXPECT_EQ(drops_for(70, {40, 0.5, 0.6}, kTenths, 100'000), 14 * kOneDrop);
  EXPECT_EQ(drops_for(70, {40, 0, 0.8}, kTenths, 100'000), 7 * kOneDrop / 2);
  EXPECT_EQ(drops_for(0, binder, kTenths, 100'000), 0u);
  EXPECT_EQ(drops_for(70, binder, kTenths, 100'000, 5), 5 * kOneDrop);
  EXPECT_EQ(drops_for(100, {300, 0, 0.6}, kTenths, 100'000), (4 * kOneDrop + 1) / 3);
  EXPECT_NEAR(voids_pl(binder, kTenths, 100'000), 400, 1e-9);
  EXPECT_NEAR(saturation_of(1, binder, kTenths, 100'000), 10, 1e-9);
  EXPECT_NEAR(saturation_of(1, {40, 0.25, 0.6}, kTenths, 100'000), 7.5, 1e-9);
}

// Against doubles, on grids that are no whole dpi too, up to the coarsest and thickest voxels.
TEST(Saturation, FollowsItsFormulaOnAnyGrid) {
  DoseRandom random(5);
  for (int i = 0; i < 2000; ++i) {
    const PixelGrid grid{PixelAxis(1000, 100'000'000, 1'000'000 + random() % 999'000'000), PixelAxis(1200, 100'000'000)};
    const Binder binder{0.5 + random() % 900, 0.01 * (random() % 90), 0.3 + 0.01 * (random() % 50)};
    const std::int64_t thickness = 5000 + random() % 2'000'000;
    const double percent = random() % 300;
    const double wanted = percent / 100 * voids_pl(binder, grid, thickness) / ((1 - binder.evaporates) * binder.drop_pl);
    const double got = static_cast<double>(drops_for(percent, binder, grid, thickness, 1u << 30)) / double{kOneDrop};
    ASSERT_NEAR(got, wanted, 1e-5 * wanted + 1e-7);
  }
}

TEST(BlueNoise, HasEachRankOnceAndIsTheSameEverywhere) {
  std::vector<std::uint16_t> ranks = blue_noise_ranks();
  EXPECT_EQ(hex(hash_bytes(std::as_bytes(std::span(ranks)))), "4e5060a14e10a4ffe9260c58414b2633");
  EXPECT_EQ(ranks, void_and_cluster_ranks()) << "make stages/dose/blue_noise_tile.h again";
  std::ranges::sort(ranks);
  for (std::uint32_t i = 0; i < kTilePixels; ++i) ASSERT_EQ(ranks[i], i);
}

// The power of a pattern by distance from the middle of its spectrum, over that of white noise.
std::vector<double> radial_power(const std::vector<int>& pattern) {
  constexpr int n = kTileSide;
  std::vector<std::complex<double>> turn(n), rows(n * n);
  for (int i = 0; i < n; ++i) turn[i] = std::polar(1.0, -2 * 3.14159265358979323846 * i / n);
  double mean = 0;
  for (const int pixel : pattern) mean += pixel / double{n * n};
  for (int y = 0; y < n; ++y) {
    for (int k = 0; k < n; ++k) {
      for (int x = 0; x < n; ++x) rows[y * n + k] += (pattern[y * n + x] - mean) * turn[k * x % n];
    }
  }
  std::vector<double> power(n), count(n);
  for (int x = 0; x < n; ++x) {
    for (int k = 0; k < n; ++k) {
      std::complex<double> sum = 0;
      for (int y = 0; y < n; ++y) sum += rows[y * n + x] * turn[k * y % n];
      const auto radius = std::lround(std::hypot(std::min(x, n - x), std::min(k, n - k)));
      power[radius] += std::norm(sum) / (n * n * mean * (1 - mean));
      count[radius] += 1;
    }
  }
  for (int r = 0; r < n; ++r) power[r] = count[r] > 0 ? power[r] / count[r] : 0;
  return power;
}

// 6 dB is a factor of 3.98; the neighbourhood of a radius is the mean of those two to four next to it.
TEST(BlueNoise, SpectrumOfFlatGreyHasNoPeakAndLittleAtLowFrequencies) {
  for (const double share : {0.1, 0.3, 0.5, 0.7, 0.9}) {
    const std::vector<double> power = radial_power(tile_pattern(share, 0));
    for (int r = 1; r <= 90; ++r) {
      double sum = 0, count = 0;
      for (int s = std::max(1, r - 4); s <= std::min(90, r + 4); ++s) {
        if (std::abs(s - r) < 2) continue;
        sum += power[s];
        ++count;
      }
      EXPECT_LT(power[r], 3.98 * sum / count) << "share " << share << ", radius " << r;
      if (r <= 8) {
        EXPECT_LT(power[r], 0.1) << "share " << share << ", radius " << r;
      }
    }
  }
}

TEST(BlueNoise, LayersAboveEachOtherDoNotRepeat) {
  for (const double share : {0.05, 0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9, 0.95}) {
    const std::vector<int> first = tile_pattern(share, 9);
    for (const std::uint32_t above : {1u, 2u, 3u, 5u, 8u}) {
      const std::vector<int> other = tile_pattern(share, 9 + above);
      double both = 0, a = 0, b = 0;
      for (std::size_t i = 0; i < first.size(); ++i) {
        both += first[i] * other[i];
        a += first[i];
        b += other[i];
      }
      const double n = kTilePixels;
      const double correlation = (both / n - a / n * b / n) / std::sqrt(a / n * (1 - a / n) * b / n * (1 - b / n));
      EXPECT_LE(correlation, 0.02) << "share " << share << ", " << above << " layers above";
    }
  }
}

TEST(Dither, MeetsADoseWithinATenthOfAPerCentInDropsOfAPart) {
  DoseRandom random(11);
  const Runs part = program::testing::runs_of(random_image(random, 400, 300));
  const double pixels = static_cast<double>(set_pixels(part));
  for (const double dose : {0.05, 0.31, 0.5, 0.7777, 1.45, 3.002, 9.33}) {
    std::uint64_t drops = 0;
    constexpr std::uint32_t kLayers = 60;
    for (std::uint32_t layer = 0; layer < kLayers; ++layer) {
      drops += sum_of_levels(dithered(part, static_cast<Drops24>(dose * kOneDrop), layer));
    }
    EXPECT_NEAR(static_cast<double>(drops) / (pixels * kLayers * dose), 1, 1e-3) << dose;
  }
}

// A pixel's drops depend on its place and dose alone, are the whole part or one more, and never fall when the dose grows.
TEST(Dither, DecidesEveryPixelByItself) {
  DoseRandom random(3);
  const Runs part = program::testing::runs_of(random_image(random, 301, 150));
  Runs whole = full_square(301);
  whole.row_offset.resize(151);
  whole.change.resize(whole.row_offset.back());
  std::vector<int> set = levels_by_pixel(dithered(part, kOneDrop, 0)), before(set.size(), 0);
  for (const double dose : {0.0, 0.2, 0.6, 1.0, 1.01, 1.99, 2.5}) {
    const auto drops = static_cast<Drops24>(dose * kOneDrop);
    const std::vector<int> of_part = levels_by_pixel(dithered(part, drops, 17)),
                           all = levels_by_pixel(dithered(whole, drops, 17));
    for (std::size_t i = 0; i < set.size(); ++i) {
      ASSERT_EQ(of_part[i], set[i] * all[i]);
      ASSERT_TRUE(all[i] == static_cast<int>(dose) || all[i] == static_cast<int>(std::ceil(dose)));
      ASSERT_GE(all[i], before[i]);
    }
    before = all;
  }
}

TEST(Dither, TakesSharesOfVoxelsInProportion) {
  std::array<Drops24, 7> drops{};
  LayerDose dose;
  dose.shell = 3 * kOneDrop;
  dose.core = kOneDrop;
  drops_of_zones(dose, 3, false, drops);
  EXPECT_EQ(drops, (std::array<Drops24, 7>{0, kOneDrop, 2 * kOneDrop, 3 * kOneDrop, 0, kOneDrop, kOneDrop}));
  drops_of_zones(dose, 3, true, drops);
  EXPECT_EQ(drops, (std::array<Drops24, 7>{0, kOneDrop, 2 * kOneDrop, 3 * kOneDrop, kOneDrop / 3, 2 * kOneDrop / 3, kOneDrop}));
  Levels coverage;
  coverage.start(9);
  coverage.append(0, 3, 1);
  coverage.append(4, 6, 3);
  coverage.append(6, 9, 2);
  coverage.end_row();
  EXPECT_EQ(levels_by_pixel(drops_of_pixels(coverage, drops, 0)), (std::vector<int>{1, 1, 1, 0, 3, 3, 2, 2, 2}));
}

// Rows of single pixels, of runs longer than words and tiles, that touch or do not, from the first column to the last.
TEST(Dither, RowsAndCountsAreThoseOfThePixels) {
  program::testing::Random random(11);
  const std::array<Drops24, 8> drops{0, kOneDrop, kOneDrop / 3, 5 * kOneDrop / 7, 0, 3, 5 * kOneDrop / 2, 3 * kOneDrop};
  for (const std::uint32_t columns : {1u, 5u, 63u, 64u, 65u, 129u, 700u}) {
    Levels shares;
    shares.start(columns);
    for (std::uint32_t r = 0; r < 150; ++r) {
      const std::uint32_t longest = 1u << (r % 10);
      for (std::uint32_t c = 0; c < columns && r % 13 != 5;) {
        const std::uint32_t end = std::min<std::uint32_t>(columns, c + 1 + random() % longest);
        shares.append(c, end, static_cast<std::uint8_t>(random() % drops.size()));
        c = end;
      }
      shares.end_row();
    }
    for (const std::uint32_t layer : {0u, 1u, 77u, 1000u}) {
      DropPatterns patterns;
      make_zones(drops, layer, patterns);
      // Each pixel by itself, by the thresholds of the layer.
      Thresholds thresholds;
      thresholds.start(layer);
      Levels levels;
      levels.start(columns);
      for (std::uint32_t r = 0; r < 150; ++r) {
        for (std::uint32_t i = shares.row_offset[r]; i < shares.row_offset[r + 1]; ++i)
          thresholds.append(shares.change[2 * i], shares.change[2 * i + 1], r, drops[shares.level[i]], levels);
        levels.end_row();
      }
      expect_rows_and_counts({shares, &patterns}, levels, 4);
      EXPECT_EQ(levels_by_pixel(drops_of_pixels(shares, drops, layer)), levels_by_pixel(levels));
    }
  }
}

TEST(Dither, MarksShellAndCore) {
  const Runs image{10, {0, 4, 6}, {0, 3, 4, 10, 2, 5}}, core{10, {0, 4, 4}, {1, 2, 4, 9}};
  Levels levels, zones;
  levels_of(image, 1, levels);
  mark_core(levels, core, 1, zones);
  EXPECT_EQ(levels_by_pixel(zones), (std::vector<int>{1, 2, 1, 0, 2, 2, 2, 2, 2, 1, 0, 0, 1, 1, 1, 0, 0, 0, 0, 0}));
}

Layer tenth(std::uint32_t index) { return {index, static_cast<Nm>(index * 100'000), 100'000, LayerReason::kUniform}; }

TEST(Budget, ReportsTargetsByHeightThoseThatAreCutAndThoseThatDoNotBind) {
  DoseTargets targets{{50, 30.0}, {{0.2, 0.4, {5, {}}}, {0.6, 0.7, {200, {}}}}};
  EXPECT_EQ(targets.of(tenth(1)).percent, 50);
  EXPECT_EQ(targets.of(tenth(2)).percent, 5);
  EXPECT_EQ(targets.of(tenth(4)).percent, 50);
  EXPECT_TRUE(targets.has_core());
  const Binder binder{40, 0, 0.6};  // 10 % a drop
  Budget budget(binder, kTenths, targets, 10, 20);
  for (std::uint32_t i = 0; i < 10; ++i) budget.foresee(tenth(i));
  EXPECT_EQ(budget.max_drops(), 10u);
  std::vector<Warning> warnings;
  const Status refused = budget.check(false, warnings);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().fault, Fault::kUsage);
  EXPECT_NE(refused.error().message.find("layers 2:4 (z 0.200 to 0.400 mm) get 5.0 %"), std::string::npos)
      << refused.error().message;
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].text.find("layers 6:7"), std::string::npos) << warnings[0].text;
  warnings.clear();
  EXPECT_TRUE(budget.check(true, warnings).ok());
  EXPECT_EQ(warnings.size(), 2u);
  Levels zones;
  zones.start(110);
  zones.append(0, 100, 1);
  zones.append(100, 110, 2);
  zones.end_row();
  EXPECT_EQ(sums_of(zones, 1, dose_of(tenth(0), targets, binder, kTenths, 10)).requested_drops, 530u);
  zones.start(110);
  zones.append(0, 100, 1);
  zones.end_row();
  EXPECT_EQ(sums_of(zones, 1, dose_of(tenth(6), targets, binder, kTenths, 10)).requested_drops, 2000u);
  BinderCount count;
  count.add(budget, tenth(0), 110, 530, 530, 0);
  EXPECT_NEAR(count.reached_percent(budget), 100 * 530 * 40 / (110 * 400.0), 1e-9);
  EXPECT_NEAR(count.binder_ml(budget), 530 * 40e-9, 1e-15);
}

TEST(Budget, WithoutATargetReportsWhatOneDropGives) {
  Budget budget({40, 0, 0.6}, kTenths, std::nullopt, 64, 0);
  budget.foresee(tenth(0));
  std::vector<Warning> warnings;
  EXPECT_TRUE(budget.check(false, warnings).ok());
  EXPECT_EQ(pipeline::binder_text(budget, {}), "one drop of 40 pl a pixel fills 10.0 % of the voids");
}

std::string refusal(const Budget& budget, std::vector<Warning>& warnings) {
  const Status status = budget.check(false, warnings);
  return status.ok() ? "" : status.error().message;
}

// 10 % a drop: 14 % is 1.4 drops, one of which is jetted; of the core's 4 % none is.
TEST(Budget, ChecksAndReportsDropsAsTheyAreRounded) {
  const Binder binder{40, 0, 0.6};
  Budget dithered(binder, kTenths, DoseTargets{{14, 4.0}, {}}, 10, 0),
      whole(binder, kTenths, DoseTargets{{14, 4.0}, {}}, 10, 0, {false, true, 1});
  for (Budget* budget : {&dithered, &whole}) budget->foresee(tenth(0));
  EXPECT_EQ(dithered.max_drops(), 2u);
  EXPECT_EQ(whole.max_drops(), 1u);
  EXPECT_NEAR(whole.gets().second, 10, 1e-9);
  EXPECT_EQ(whole.gets().first, 0);
  std::vector<Warning> warnings;
  EXPECT_EQ(refusal(dithered, warnings), "");
  EXPECT_TRUE(warnings.empty());
  EXPECT_EQ(refusal(whole, warnings), "");
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].text.find("--core-saturation: 4 % is 0.40 drops a pixel, which rounds to none in layers 0:1"), 0u)
      << warnings[0].text;
  Budget bound(binder, kTenths, DoseTargets{{14, {}}, {}}, 10, 12, {false, true, 1});
  bound.foresee(tenth(0));
  EXPECT_NE(refusal(bound, warnings).find("get 10.0 %"), std::string::npos) << refusal(bound, warnings);
}

TEST(Budget, ChecksTheShareOfACore) {
  const Binder binder{40, 0, 0.6};
  std::vector<Warning> warnings;
  Budget core(binder, kTenths, std::nullopt, 64, 1, {true, false, 0.05}),
      shell(binder, kTenths, std::nullopt, 64, 1, {true, true, 0.05});
  for (Budget* budget : {&core, &shell}) budget->foresee(tenth(0));
  EXPECT_NE(refusal(core, warnings).find("get 0.5 %"), std::string::npos) << refusal(core, warnings);
  EXPECT_NE(refusal(shell, warnings).find("get 0.5 %"), std::string::npos) << refusal(shell, warnings);
  EXPECT_EQ(pipeline::binder_text(core, {}), "one drop of 40 pl a pixel, of the core's 5 %, fills 0.5 % of the voids");
  EXPECT_EQ(pipeline::binder_text(shell, {}), "one drop of 40 pl a pixel, of the core's 5 %, fills 0.5 to 10.0 % of the voids");
}

TEST(Budget, NamesTheWorstDose) {
  const Binder binder{40, 0, 0.6};
  std::vector<Warning> warnings;
  Budget budget(binder, kTenths, DoseTargets{{15, {}}, {{0.2, 0.3, {5, {}}}}, {DoseTarget{8, {}}}}, 64, 20);
  for (std::uint32_t i = 0; i < 4; ++i) budget.foresee(tenth(i));
  const std::string text = refusal(budget, warnings);
  EXPECT_NE(text.find("layers 0:4 (z 0.000 to 0.400 mm) get as little as 5.0 % of their voids filled where 5 % is requested"),
            std::string::npos)
      << text;
}

TEST(Budget, ReportsAPartWithoutADrop) {
  std::vector<Warning> warnings;
  Budget budget({40, 0, 0.6}, kTenths, DoseTargets{{100, {}}, {}, {DoseTarget{0, {}}, DoseTarget{50, {}}}}, 64, 0);
  budget.foresee(tenth(0));
  EXPECT_EQ(refusal(budget, warnings), "");
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].text, "part.saturation_percent: 0: that part stays loose powder");
}

// Zone 0 has no part; that of zone 1 stands at 0.2 to 0.35 mm and is too narrow for a core.
TEST(Budget, InspectsWhatIsThere) {
  const DoseTargets targets{{5000, {}}, {{0, 0.2, {1, {}}}}, {DoseTarget{70, 5.0}}};
  const ZoneBox box{1, {0, 0, 200'000}, {5'000'000, 30'000'000, 350'000}};
  Budget budget({40, 0, 0.6}, kTenths, targets, 64, 30, {true, true, 1}, CoveredSpans({&box, 1}, 2, 9'000'000, 100'000));
  for (std::uint32_t i = 0; i < 6; ++i) budget.foresee(tenth(i));
  std::vector<Warning> warnings;
  EXPECT_EQ(refusal(budget, warnings), "");
  EXPECT_TRUE(warnings.empty());
  EXPECT_EQ(budget.max_drops(), 7u);
  EXPECT_NEAR(budget.gets().first, 70, 1e-4);
}

TEST(CoveredSpans, AreThoseOfBoxesAndOfCoresOfPartsThatTouch) {
  // Two boxes of 6 mm side by side, one of 12 mm above and apart.
  const std::vector<ZoneBox> boxes{{0, {0, 0, 0}, {6'000'000, 12'000'000, 200'000}},
                                   {1, {6'000'000, 0, 0}, {12'000'000, 12'000'000, 150'000}},
                                   {1, {40'000'000, 0, 300'000}, {46'000'000, 12'000'000, 500'000}}};
  const CoveredSpans spans(boxes, 2, 5'000'000, 30'000);
  const auto detected = [&](std::uint32_t zone) {
    std::string text;
    for (std::uint32_t i = 0; i < 6; ++i) text += spans.core(zone, tenth(i)) ? 'c' : spans.any(zone, tenth(i)) ? 's' : '.';
    return text;
  };
  EXPECT_EQ(detected(0), "cc....");
  EXPECT_EQ(detected(1), "cc.ss.");
}

}  // namespace
}  // namespace lamina::dose
