// Saturations by formulas, held against integrals by hand, and doses that are poured together.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>
#include <vector>

#include "stages/dose/budget.h"
#include "stages/dose/field.h"
#include "stages/dose/layer_drops.h"
#include "stages/dose/shares.h"
#include "tests/program/machines.h"

namespace lamina::dose {
namespace {

// A bed of 20 mm in pixels of 100 um; a voxel of 100 um holds 400 pl of voids, so that a drop fills a tenth.
const PixelGrid kBed{PixelAxis(254, 20'000'000), PixelAxis(254, 20'000'000)};
const Binder kForty{40, 0, 0.6};

Layer tenth_of(std::uint32_t index) { return {index, static_cast<Nm>(100'000 * index), 100'000}; }

Sheet sheet_of(std::uint32_t layer) {
  Sheet sheet{kBed, false, false, tenth_of(layer), DropScale(kForty, kBed, 100'000)};
  sheet.limit = Drops24{64} << kDropBits;
  return sheet;
}

/// Pixels whose centres, in mm, are inside.
template <class Inside>
Levels levels_where(const Inside& inside, std::uint8_t level = 1) {
  Levels levels;
  levels.start(kBed.columns());
  for (std::uint32_t row = 0; row < kBed.rows(); ++row) {
    for (std::uint32_t column = 0; column < kBed.columns(); ++column) {
      if (inside(mm(kBed.x.centre(column)), mm(kBed.y.centre(kBed.rows() - 1 - row)))) levels.append(column, column + 1, level);
    }
    levels.end_row();
  }
  return levels;
}
Levels everywhere() {
  return levels_where([](double, double) { return true; });
}

struct Poured {
  ZoneSums sums;
  Levels drops, levels;
};
Poured poured(const Sheet& sheet, const Levels& image, const std::string& formula, std::span<const ZoneBox> copies = {}) {
  Field field;
  EXPECT_TRUE(field.start(formula, "--saturation", sheet, copies).ok());
  const Dosed part{image, {0, &field}, {0, &field}};
  PourScratch scratch;
  Poured result;
  const auto sums = pour({&part, 1}, 1, sheet, scratch, result.drops, result.levels);
  EXPECT_TRUE(sums.ok()) << (sums.ok() ? "" : sums.error().message);
  if (sums) result.sums = *sums;
  return result;
}

std::uint64_t drops_between(const Levels& drops, std::uint32_t first, std::uint32_t last) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < drops.level.size(); ++i) {
    const std::uint32_t from = std::max(first, drops.change[2 * i]), to = std::min(last, drops.change[2 * i + 1]);
    if (from < to) sum += std::uint64_t{to - from} * drops.level[i];
  }
  return sum;
}

// 10 x % is x drops: over 20 mm ten on average, of 40,000 pixels.
TEST(Field, RampAlongXIsItsIntegral) {
  std::uint64_t drops = 0;
  for (std::uint32_t layer = 0; layer < 16; ++layer) {
    const Poured of = poured(sheet_of(layer), everywhere(), "10*x");
    EXPECT_EQ(of.sums.full_voxels, 40'000u);
    EXPECT_EQ(of.sums.requested_drops, 400'000u);
    EXPECT_NEAR(static_cast<double>(drops_between(of.drops, 0, 50)), 50 * 200 * 2.5, 0.01 * 50 * 200 * 2.5);
    drops += sum_of_levels(of.drops);
  }
  EXPECT_NEAR(static_cast<double>(drops), 16 * 400'000.0, 16 * 400.0);
}

// Integral of 40 + 60 exp(-z / 5) over 20 mm: 800 + 300 (1 - exp(-4)) per cent mm, a tenth of a drop each.
TEST(Field, DecayAlongZIsItsIntegral) {
  const Levels image = levels_where([](double x, double y) { return x < 3 && y < 4; });
  std::uint64_t requested = 0, drops = 0;
  for (std::uint32_t layer = 0; layer < 200; ++layer) {
    const Poured of = poured(sheet_of(layer), image, "40+60*exp(-z/5)");
    requested += of.sums.requested_drops;
    drops += sum_of_levels(of.drops);
  }
  const double integral = 1200 * (800 + 300 * (1 - std::exp(-4))) / 0.1 / 10;
  EXPECT_NEAR(static_cast<double>(requested), integral, 1e-4 * integral);
  EXPECT_NEAR(static_cast<double>(drops), integral, 1e-3 * integral);
}

// Over a disc of radius R: 50 pi R^2 + 2 (2 pi R^3 / 3) per cent mm2.
TEST(Field, RadialOneIsItsIntegral) {
  const Levels disc = levels_where([](double x, double y) { return std::hypot(x - 10, y - 10) < 8; });
  std::uint64_t requested = 0, drops = 0;
  for (std::uint32_t layer = 0; layer < 16; ++layer) {
    const Poured of = poured(sheet_of(layer), disc, "50+2*sqrt((x-10)^2+(y-10)^2)");
    requested += of.sums.requested_drops;
    drops += sum_of_levels(of.drops);
  }
  const double integral = 16 * std::numbers::pi * (50 * 64 + 4.0 / 3 * 512) / 0.01 / 10;
  EXPECT_NEAR(static_cast<double>(requested), integral, 1e-3 * integral);
  EXPECT_NEAR(static_cast<double>(drops), integral, 1e-3 * integral);
}

// A formula that gives the same everywhere gives the drops of the number.
TEST(Field, ConstantOneIsTheNumber) {
  const Levels image = levels_where([](double x, double y) { return std::hypot(x - 10, y - 10) < 8 && x * y < 120; });
  for (const std::string number : {"73.21", "100", "4.000001"}) {
    const double percent = std::stod(number);
    const std::array<Drops24, 2> table{0, drops_for(percent, kForty, kBed, 100'000)};
    EXPECT_EQ(DropScale(kForty, kBed, 100'000).drops(percent), table[1]);
    DropPatterns patterns;
    make_zones(table, 7, patterns);
    Levels plain;
    levels_of(DropImageView{image, &patterns}, plain);
    for (const std::string& formula : {number, number + "+0*x*y"}) {
      const Poured of = poured(sheet_of(7), image, formula);
      EXPECT_TRUE(std::ranges::equal(of.drops.change, plain.change) && std::ranges::equal(of.drops.level, plain.level));
      EXPECT_TRUE(std::ranges::equal(of.levels.change, image.change));
    }
  }
}

TEST(Field, ScaleIsThatOfOneTarget) {
  for (const double drop : {0.5, 12.0, 80.0}) {
    for (const std::int64_t thickness : {30'000, 178'000, 500'000}) {
      const Binder binder{drop, 0.07, 0.55};
      for (double percent = 0.013; percent < 10'000; percent *= 1.37) {
        EXPECT_EQ(DropScale(binder, kBed, thickness).drops(percent), drops_for(percent, binder, kBed, thickness, 1u << 20));
      }
    }
  }
}

// An odd number of columns: blocks count from the bed, whichever way the image runs.
TEST(Field, MirroredImageIsThatOfTheBed) {
  const PixelGrid odd{PixelAxis(254, 10'100'000), PixelAxis(254, 700'000)};
  for (const bool mirrored : {false, true}) {
    Sheet sheet = sheet_of(0);
    sheet.grid = odd;
    sheet.mirror_x = mirrored;
    sheet.mirror_y = mirrored;
    sheet.dithered = false;
    Levels all;
    all.start(odd.columns());
    for (std::uint32_t row = 0; row < odd.rows(); ++row) all.append(0, odd.columns(), 1), all.end_row();
    const Poured of =
        poured(sheet, all, "10*rint(x/0.4+0.5)+100*(y>0.4)");  // by block: 1, 2, 3 drops, and ten in the second row
    for (std::uint32_t i = 0; i < of.drops.level.size(); ++i) {
      const std::uint32_t begin = of.drops.change[2 * i], end = of.drops.change[2 * i + 1];
      const std::uint32_t block = (mirrored ? odd.columns() - end : begin) / 4;
      EXPECT_TRUE(of.drops.level[i] == block + 1 || of.drops.level[i] == block + 11) << begin;
    }
    const std::uint32_t first_row = of.drops.row_offset[1];
    ASSERT_EQ(first_row, 26u);
    EXPECT_EQ(of.drops.level[mirrored ? 25 : 0], mirrored ? 1 : 11);  // row 0 is the back of the bed
  }
}

// Copies of a part count from their own corners.
TEST(Field, CopiesHaveTheirOwnFrames) {
  std::vector<ZoneBox> copies;
  for (const std::int64_t x : {2'000'000, 10'000'000})
    copies.push_back({1, {x, 4'000'000, 0}, {x + 6'000'000, 10'000'000, 200'000}, {x, 4'000'000, 0}});
  Sheet sheet = sheet_of(1);
  sheet.dithered = false;
  const Levels image =
      levels_where([](double x, double y) { return y > 4 && y < 10 && ((x > 2 && x < 8) || (x > 10 && x < 16)); });
  const Poured of = poured(sheet, image, "10*x+100*(z>0.1)", copies);
  EXPECT_EQ(drops_between(of.drops, 20, 80), drops_between(of.drops, 100, 160));
  EXPECT_NEAR(static_cast<double>(drops_between(of.drops, 20, 80)), 3600 * 13.0, 3600 * 0.05);
  copies[1].low[2] = copies[1].high[2] = 300'000;  // not in this layer: what lies there is nearest to the other one
  const Poured left = poured(sheet, image, "10*x+100*(z>0.1)", copies);
  EXPECT_NEAR(static_cast<double>(drops_between(left.drops, 100, 160)), 3600 * 21.0, 3600 * 0.05);
}

std::vector<int> pixels_of(const LevelsView& levels) {
  std::vector<int> pixels(std::size_t{levels.columns} * levels.rows(), 0);
  for (std::uint32_t r = 0; r < levels.rows(); ++r) {
    for (std::uint32_t i = levels.row_offset[r]; i < levels.row_offset[r + 1]; ++i) {
      for (std::uint32_t c = levels.change[2 * i]; c < levels.change[2 * i + 1]; ++c)
        pixels[std::size_t{r} * levels.columns + c] = levels.level[i];
    }
  }
  return pixels;
}

std::string fault_of(const std::string& formula, Sheet sheet) {
  Field field;
  if (const Status status = field.start(formula, "--saturation", sheet, {}); !status) return status.error().message;
  const Levels image = levels_where([](double x, double y) { return x > 12 && x < 15 && y > 2 && y < 3; });
  const Dosed part{image, {0, &field}, {0, &field}};
  PourScratch scratch;
  Levels drops, levels;
  const auto sums = pour({&part, 1}, 1, sheet, scratch, drops, levels);
  return sums ? "" : sums.error().message;
}

TEST(Field, FaultsAreReportedWhereAPartLies) {
  Sheet sheet = sheet_of(2);
  EXPECT_EQ(fault_of("max(0,x-12)", sheet), "");  // below 0 elsewhere, were it not for max
  EXPECT_EQ(fault_of("x-12", sheet), "");
  EXPECT_EQ(fault_of("x-13", sheet),
            "--saturation 'x-13': is -0.8 % in layer 2 at x 12.200, y 3.000, z 0.250 mm; it has to be a number "
            "from 0 to 10000: put it into max(0, ...)");
  EXPECT_NE(fault_of("sqrt(x-13)", sheet).find("is nan % in layer 2 at x 12.200"), std::string::npos);
  EXPECT_NE(fault_of("1/(x-x)", sheet).find("is inf %"), std::string::npos);
  EXPECT_NE(fault_of("40+*x", sheet).find("variables are x, y and z"), std::string::npos);
  EXPECT_NE(fault_of("x=3", sheet).find("write == to compare"), std::string::npos);
  sheet.minimum = sheet.scale.drops(30);
  sheet.min_percent = 30;
  EXPECT_EQ(fault_of("31+0*x", sheet), "");
  EXPECT_NE(fault_of("2*x", sheet).find("is 24.4 % in layer 2"), std::string::npos) << fault_of("2*x", sheet);
  EXPECT_NE(fault_of("2*x", sheet).find("binds from 30 % on"), std::string::npos);
}

// Shares of a voxel add up, and so do their drops; what several parts pour is what one part of all pours.
TEST(Pour, PartsThatShareAVoxelAddUp) {
  Sheet sheet = sheet_of(3);
  const Levels left = levels_where([](double x, double) { return x < 9; }, 10),
               right = levels_where([](double x, double) { return x > 7; }, 5),
               core = levels_where([](double x, double) { return x > 4 && x < 6; }, 25);
  PourScratch scratch;
  Levels drops, levels;
  const Drops24 request = 3 * kOneDrop / 2;
  const std::array parts{Dosed{left, {request}, {request}}, Dosed{right, {2 * request}, {2 * request}}};
  const auto sums = pour(parts, 15, sheet, scratch, drops, levels);
  ASSERT_TRUE(sums.ok());
  // 90 columns at 10, 130 at 5, of 15; 20 of them have both.
  EXPECT_EQ(sums->full_voxels, 200u * (90 * 10 + 130 * 5) / 15 + 1);
  EXPECT_EQ(sums->requested_drops, 200u * (90 * 10 * 15 + 130 * 5 * 30) / 150);
  EXPECT_NEAR(static_cast<double>(sum_of_levels(drops)), static_cast<double>(sums->requested_drops), 60);
  EXPECT_EQ(sum_of_levels(levels), 200u * (90 * 10 + 130 * 5));
  // Between 7 and 9 mm a voxel is full: 1 drop of the left one and 1 of the right one.
  EXPECT_EQ(drops_between(drops, 70, 90), 200u * 20 * 2);
  const std::vector<int> pixels = pixels_of(drops);
  EXPECT_EQ(std::accumulate(pixels.begin(), pixels.end(), std::uint64_t{0}), sum_of_levels(drops));  // no run lies on another
  EXPECT_EQ(std::count(pixels.begin() + 70, pixels.begin() + 90, 2), 20);
  const Dosed inside{core, {request}, {4 * kOneDrop}};
  ASSERT_TRUE(pour({&inside, 1}, 15, sheet, scratch, drops, levels).ok());
  EXPECT_NEAR(static_cast<double>(sum_of_levels(drops)), 200 * 20 * 4 * 10 / 15.0, 40);
  const Levels rest = levels_where([](double x, double) { return x > 9; }, 10);
  const std::array halves{Dosed{left, {request}, {request}}, Dosed{rest, {request}, {request}}};
  Levels whole_drops, whole;
  const Levels all = levels_where([](double, double) { return true; }, 10);
  const Dosed together{all, {request}, {request}};
  ASSERT_TRUE(pour(halves, 15, sheet, scratch, drops, levels).ok());
  ASSERT_TRUE(pour({&together, 1}, 15, sheet, scratch, whole_drops, whole).ok());
  EXPECT_TRUE(std::ranges::equal(drops.change, whole_drops.change) && std::ranges::equal(drops.level, whole_drops.level));
}

// Pixel by pixel: the last part keeps its level, each one before it what is left.
TEST(ShareOut, NoVoxelIsFilledTwice) {
  program::testing::Random random(11);
  constexpr std::uint32_t kColumns = 37, kRows = 60, kParts = 4;
  std::vector<Levels> parts(kParts);
  std::vector<std::vector<int>> before;
  for (Levels& part : parts) {
    part.start(kColumns);
    for (std::uint32_t r = 0; r < kRows; ++r) {
      for (std::uint32_t at = random() % 9; at < kColumns && r % 5 > 0; at += random() % 3) {
        const std::uint32_t stop = std::min(kColumns, at + 1 + random() % 6);
        part.append(at, stop, static_cast<std::uint8_t>(random() % 16));
        at = stop;
      }
      part.end_row();
    }
    before.push_back(pixels_of(part));
  }
  std::vector<Levels*> pointers;
  for (Levels& part : parts) pointers.push_back(&part);
  ShareOut out;
  Levels total;
  share_out(pointers, 15, out, total);
  const std::vector<int> sum = pixels_of(total);
  std::vector<std::vector<int>> after, owner;
  for (std::uint32_t i = 0; i < kParts; ++i) {
    after.push_back(pixels_of(parts[i]));
    Levels owned;
    levels_of(out.owner[i], 1, owned);
    owner.push_back(pixels_of(owned));
  }
  for (std::size_t p = 0; p < sum.size(); ++p) {
    int left = 15, maximum = 0, whose = -1;
    for (int i = kParts - 1; i >= 0; --i) {
      const int own = std::min(left, before[i][p]);
      ASSERT_EQ(after[i][p], own) << p;
      left -= own;
      if (own > maximum) maximum = own, whose = i;
    }
    ASSERT_EQ(sum[p], 15 - left) << p;
    for (int i = 0; i < static_cast<int>(kParts); ++i) ASSERT_EQ(owner[i][p], 15 - left >= 8 && i == whose ? 1 : 0) << p;
  }
}

TEST(Budget, ForeseesFormulasInTheBoxesOfParts) {
  const ZoneBox box{0, {2'000'000, 2'000'000, 0}, {6'000'000, 3'000'000, 400'000}, {2'000'000, 2'000'000, 0}};
  std::vector<Warning> warnings;
  const auto budget_of = [&](const std::string& formula, double minimum) {
    Budget budget(kForty, kBed, DoseTargets{{Saturation::of(formula), {}}, {}}, 8, minimum, {true, true, 1},
                  CoveredSpans({&box, 1}, 1, 0, 100'000));
    budget.survey({box}, 6);
    for (std::uint32_t i = 0; i < 6; ++i) budget.foresee(tenth_of(i));
    return budget;
  };
  EXPECT_EQ(budget_of("10*x", 0).max_drops(), 7u);   // up to 6.2 mm, the middle of the last block
  EXPECT_EQ(budget_of("100*z", 0).max_drops(), 4u);  // 35 % in the last layer with the part
  EXPECT_EQ(budget_of("x-20", 0).max_drops(), 0u);   // none is a number of per cent
  Budget cut = budget_of("20*x", 0);
  EXPECT_TRUE(cut.check(false, warnings).ok());
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].text.find("needs more than the 8 drops"), std::string::npos) << warnings[0].text;
  warnings.clear();
  EXPECT_FALSE(budget_of("10*x", 70).check(false, warnings).ok());  // nowhere enough
  EXPECT_TRUE(budget_of("10*x", 40).check(false, warnings).ok());   // enough somewhere: judged where parts lie
  EXPECT_TRUE(warnings.empty());
  EXPECT_TRUE(budget_of("10*x", 40).check(true, warnings).ok());
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].text.find("as little as 22.0 %"), std::string::npos) << warnings[0].text;
}

}  // namespace
}  // namespace lamina::dose
