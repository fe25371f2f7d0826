// Melt without room between its neighbours flows along its line: volume, symmetry, and what stays.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stages/bead/deposition.h"

namespace lamina::bead {
namespace {

constexpr double kAlongHeight = 0.3, kAlongSpacing = 0.44;  // mm

/// Three lines of 4 mm next to each other, `thick` wide between 1.8 and 2.2 mm, else 0.40 mm.
Buffer<DepositedPiece> crowded_lines(double thick) {
  Buffer<DepositedPiece> pieces;
  for (int line = 0; line < 3; ++line)
    for (int i = 0; i < 200; ++i) {
      const double width = i >= 90 && i < 110 ? thick : 0.40;
      const auto y = static_cast<Nm>(std::lround(line * kAlongSpacing * 1e6));
      pieces.push_back({{20'000 * i, y}, {20'000 * (i + 1), y}, bead_area(width, kAlongHeight), width});
    }
  return pieces;
}

double volume_along(const Buffer<DepositedPiece>& pieces) {
  double sum = 0;
  for (const DepositedPiece& p : pieces) sum += p.area_mm2 * (mm(p.to.x) - mm(p.from.x));
  return sum;
}

TEST(FlowAlong, WhatHasNoSpaceGoesToTheNearestPositionsThatHaveSome) {
  Buffer<DepositedPiece> pieces = crowded_lines(0.56);
  const Buffer<DepositedPiece> before = pieces;
  Buffer<PieceSides> sides;
  Buffer<PieceClearance> clearances;
  const double over = find_contacts(pieces, kAlongHeight, sides, clearances);
  ASSERT_GT(over, 1e-3);
  EXPECT_LT(flow_along(pieces, kAlongHeight, sides), 0.05 * over);
  EXPECT_NEAR(volume_along(pieces), volume_along(before), 1e-9);
  const std::size_t middle = 200;
  EXPECT_LT(pieces[middle + 100].area_mm2, before[middle + 100].area_mm2 - 1e-3);
  double ahead = 0, behind = 0;
  for (std::size_t i = 0; i < 90; ++i) {
    behind += pieces[middle + i].area_mm2 - before[middle + i].area_mm2;
    ahead += pieces[middle + 199 - i].area_mm2 - before[middle + 199 - i].area_mm2;
    EXPECT_GE(pieces[middle + i].area_mm2, before[middle + i].area_mm2 - 1e-12);
    EXPECT_GE(pieces[middle + i].width_mm, before[middle + i].width_mm - 1e-12);
  }
  EXPECT_GT(ahead, 1e-3);
  EXPECT_NEAR(ahead, behind, 0.01 * ahead) << "half of it to either side";
  EXPECT_EQ(pieces[middle + 20].area_mm2, before[middle + 20].area_mm2) << "far away nothing changes";
}

TEST(FlowAlong, BeadsWithSpaceStayAsTheyAre) {
  Buffer<DepositedPiece> pieces = crowded_lines(0.44);
  const Buffer<DepositedPiece> before = pieces;
  Buffer<PieceSides> sides, alone;
  Buffer<PieceClearance> clearances;
  EXPECT_EQ(flow_along(pieces, kAlongHeight, sides), find_contacts(before, kAlongHeight, alone, clearances));
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    EXPECT_EQ(pieces[i].area_mm2, before[i].area_mm2);
    EXPECT_EQ(pieces[i].width_mm, before[i].width_mm);
    EXPECT_EQ(sides[i].left.reach_mm, alone[i].left.reach_mm);
  }
}

TEST(FlowAlong, LinesThatAreFullAllAlongKeepTheirVolumeAndReportWhatIsOver) {
  Buffer<DepositedPiece> pieces = crowded_lines(0.56);
  for (DepositedPiece& p : pieces) p.area_mm2 = bead_area(0.56, kAlongHeight), p.width_mm = 0.56;
  const double volume = volume_along(pieces);
  Buffer<PieceSides> sides;
  EXPECT_GT(flow_along(pieces, kAlongHeight, sides), 1e-3);
  EXPECT_NEAR(volume_along(pieces), volume, 1e-9);
  pieces.clear();
  EXPECT_EQ(flow_along(pieces, kAlongHeight, sides), 0);
}

}  // namespace
}  // namespace lamina::bead
