#include <gtest/gtest.h>

#include <random>

#include "stages/geometry/combine.h"
#include "stages/raster/beads.h"

namespace lamina::raster {
namespace {

/// Whether a point lies in a bead, asked in the widest integers there are and for every pixel.
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
    BeadRaster raster(grid);
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
