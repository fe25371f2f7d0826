#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <string>

#include "stages/geometry/combine.h"
#include "stages/raster/beads.h"

namespace lamina::raster {
namespace {

/// Whether a point is in a bead, computed in the widest integers there are and for every pixel.
bool covers(Point2 a, Point2 b, std::int64_t width, BeadEnds ends, std::int64_t px, std::int64_t py) {
  __extension__ using Wide = __int128;
  const Wide dx = b.x - a.x, dy = b.y - a.y, x = px - a.x, y = py - a.y, w2 = static_cast<Wide>(width) * width;
  const Wide l2 = dx * dx + dy * dy, t = x * dx + y * dy;
  if (ends == BeadEnds::kSquare && (l2 == 0 || t < 0 || t > l2)) return false;
  if (l2 == 0 || t < 0) return 4 * (x * x + y * y) <= w2;
  if (t > l2) return 4 * ((x - dx) * (x - dx) + (y - dy) * (y - dy)) <= w2;
  const Wide cross = x * dy - y * dx;
  return 4 * cross * cross <= w2 * l2;
}

std::vector<bool> bits_of(const RunsView& runs) {
  std::vector<bool> bits(std::size_t{runs.rows()} * runs.columns);
  for (std::uint32_t r = 0; r < runs.rows(); ++r) {
    const auto row = runs.row(r);
    EXPECT_EQ(row.size() % 2, 0);
    for (std::size_t i = 1; i < row.size(); ++i) EXPECT_LT(row[i - 1], row[i]);
    for (std::size_t i = 0; i < row.size(); i += 2) {
      for (std::uint32_t c = row[i]; c < row[i + 1]; ++c) bits[std::size_t{r} * runs.columns + c] = true;
    }
  }
  return bits;
}

constexpr std::array kSets{Isa::kPlain, Isa::kAvx2, Isa::kAvx512};  // what a processor lacks becomes what it has

TEST(BeadRaster, SetsThePixelsWhoseCentresLieInABeadAndNoOthers) {
  std::mt19937_64 random(3);
  for (int round = 0; round < 150; ++round) {
    const std::int64_t dpi = round % 2 == 0 ? 600 : 254;
    const PixelGrid grid{PixelAxis(dpi, 5'000'000), PixelAxis(dpi + (round % 3) * 100, 4'000'000)};
    // Steps of whole pixels at 254 dpi put many centres exactly on edges.
    const std::int64_t step = round % 4 == 1 ? 50'000 : 1;
    const auto position = [&](std::int64_t limit) {
      return static_cast<Nm>(std::uniform_int_distribution<std::int64_t>(-300'000 / step, (limit + 300'000) / step)(random) *
                             step);
    };
    const int beads = round % 5 + 1;
    std::vector<std::tuple<Point2, Point2, Nm, BeadEnds>> list;
    BeadRaster raster(grid, kSets[static_cast<std::size_t>(round) % kSets.size()]);
    for (int i = 0; i < beads; ++i) {
      const Point2 a{position(5'000'000), position(4'000'000)};
      Point2 b{position(5'000'000), position(4'000'000)};
      const int kind = static_cast<int>(random() % 5);
      if (kind == 0) b.y = a.y;
      if (kind == 1) b.x = a.x;
      if (kind == 2) b = a;
      const auto width = static_cast<Nm>((random() % 8 + 1) * 100'000);
      const BeadEnds ends = random() % 2 == 0 ? BeadEnds::kRound : BeadEnds::kSquare;
      list.emplace_back(a, b, width, ends);
      raster.add(a, b, width, ends);
    }
    Runs runs;
    raster.runs(runs);
    ASSERT_EQ(runs.view().rows(), grid.rows());
    const auto bits = bits_of(runs);
    for (std::uint32_t r = 0; r < grid.rows(); ++r) {
      for (std::uint32_t c = 0; c < grid.columns(); ++c) {
        bool expected = false;
        for (const auto& [a, b, width, ends] : list) {
          expected = expected || covers(a, b, width, ends, grid.x.centre(c), grid.y.centre(grid.rows() - 1 - r));
        }
        ASSERT_EQ(bits[std::size_t{r} * grid.columns() + c], expected) << round << " row " << r << " column " << c;
      }
    }
  }
}

/// Lines over many bands at any slope, among them flat, upright and slightly tilted ones, and short walls; where runs begin and
/// end is decided by the widest integers.
TEST(BeadRaster, LongLinesBeginAndEndWhereIntegersDecideOnEveryInstructionSet) {
  std::mt19937_64 random(11);
  const auto any = [&](std::int64_t low, std::int64_t high) {
    return std::uniform_int_distribution<std::int64_t>(low, high)(random);
  };
  for (int round = 0; round < 40; ++round) {
    const std::int64_t dpi = round % 2 == 0 ? 1200 : 254;
    const std::int64_t depth = round % 8 == 6 ? 400'000'000 : 40'000'000;  // a line may be on 18,900 rows
    const PixelGrid grid{PixelAxis(dpi, 40'000'000), PixelAxis(round % 3 == 0 ? 600 : dpi, depth)};
    std::vector<std::tuple<Point2, Point2, Nm, BeadEnds>> list;
    for (int i = 0; i < 12; ++i) {
      const Point2 a{static_cast<Nm>(any(-1'000'000, 41'000'000)), static_cast<Nm>(any(-1'000'000, depth + 1'000'000))};
      const std::int64_t far = i % 3 == 0 ? 500'000 : 40'000'000, far_y = i % 3 == 0 ? far : depth;
      Point2 b{static_cast<Nm>(a.x + any(-far, far)), static_cast<Nm>(a.y + any(-far_y, far_y))};
      if (i % 4 == 1) b.x = static_cast<Nm>(a.x + any(-2, 2));
      if (i % 4 == 2) b.y = static_cast<Nm>(a.y + any(-2, 2));
      list.emplace_back(a, b, static_cast<Nm>(any(20'000, 1'500'000)), round % 5 == 0 ? BeadEnds::kSquare : BeadEnds::kRound);
    }
    Runs plain;
    for (const Isa isa : kSets) {
      BeadRaster raster(grid, isa);
      for (const auto& [a, b, width, ends] : list) raster.add(a, b, width, ends);
      Runs runs;
      raster.runs(runs);
      if (isa == Isa::kPlain) plain = runs;
      ASSERT_EQ(runs.row_offset, plain.row_offset) << round;
      ASSERT_EQ(runs.change, plain.change) << round;
    }
    const auto covered = [&](std::int64_t column, std::int64_t y) {
      return std::ranges::any_of(list, [&](const auto& bead) {
        const auto& [a, b, width, ends] = bead;
        return covers(a, b, width, ends, grid.x.centre(column), y);
      });
    };
    for (std::uint32_t r = 0; r < grid.rows(); ++r) {
      const std::int64_t y = grid.y.centre(grid.rows() - 1 - r);
      bool set = false;
      for (const std::uint32_t column : plain.view().row(r)) {
        set = !set;
        const std::string where = std::to_string(round) + " row " + std::to_string(r) + " column " + std::to_string(column);
        ASSERT_TRUE(column == grid.columns() || covered(column, y) == set) << where;
        ASSERT_TRUE(column == 0 || covered(column - 1, y) == !set) << where;
      }
      const auto column = static_cast<std::uint32_t>(any(0, grid.columns() - 1));  // between changes
      const auto row = plain.view().row(r);
      const auto changes = std::ranges::upper_bound(row, column) - row.begin();
      ASSERT_EQ(covered(column, y), changes % 2 != 0) << round << " row " << r << " column " << column;
    }
  }
}

TEST(BeadRaster, SetOperationsAreThoseOfTheirPixels) {
  std::mt19937 random(5);
  const auto any = [&] {
    Runs runs;
    runs.columns = 40;
    runs.row_offset = {0};
    for (int r = 0; r < 30; ++r) {
      for (std::uint32_t c = static_cast<std::uint32_t>(random() % 5); c + 1 < 40;) {
        runs.change.push_back(c);
        c += 1 + static_cast<std::uint32_t>(random() % 6);
        runs.change.push_back(std::min(c, 40u));
        c += 1 + static_cast<std::uint32_t>(random() % 6);
      }
      runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
    }
    return runs;
  };
  for (int round = 0; round < 50; ++round) {
    const Runs a = any(), b = any();
    const auto p = bits_of(a), q = bits_of(b);
    const auto differs = static_cast<std::size_t>(std::ranges::mismatch(p, q).in1 - p.begin());
    const auto [column, row] = first_difference(a, b);
    ASSERT_EQ(differs, std::size_t{row} * 40 + column);
    for (const SetOperation operation : {SetOperation::kUnion, SetOperation::kIntersection, SetOperation::kDifference}) {
      Runs out;
      combine(a, b, operation, out);
      const auto bits = bits_of(out);
      for (std::size_t i = 0; i < bits.size(); ++i) {
        const bool expected = operation == SetOperation::kUnion          ? p[i] || q[i]
                              : operation == SetOperation::kIntersection ? p[i] && q[i]
                                                                         : p[i] && !q[i];
        ASSERT_EQ(bits[i], expected);
      }
    }
  }
}

}  // namespace
}  // namespace lamina::raster
