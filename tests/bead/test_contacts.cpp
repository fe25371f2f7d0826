// Beads next to each other on a bed: their sections contain the deposited area and agree with those of whole rows.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stages/bead/deposition.h"
#include "tests/bead/neighbours.h"

namespace lamina::bead {
namespace {

constexpr double kContactHeight = 0.3;  // mm

/// Lines of pieces along a direction, `angle` from x, each with its own phase.
Buffer<DepositedPiece> rows_of_pieces(const std::vector<double>& centres, const std::vector<double>& widths, double angle) {
  Buffer<DepositedPiece> pieces;
  const double c = std::cos(angle), s = std::sin(angle);
  const auto at = [&](double along, double across) {
    return Point2{static_cast<Nm>(std::lround((along * c - across * s) * 1e6)),
                  static_cast<Nm>(std::lround((along * s + across * c) * 1e6))};
  };
  for (std::size_t l = 0; l < centres.size(); ++l)
    for (int i = 0; i < 100; ++i) {
      const double from = 0.02 * i + 0.007 * static_cast<double>(l);
      pieces.push_back({at(from, centres[l]), at(from + 0.02, centres[l]), bead_area(widths[l], kContactHeight), widths[l]});
    }
  return pieces;
}

/// mm2, by slices
double half_section_of(const DepositedPiece& piece, const PieceSide& side) {
  constexpr int kSlices = 3000;
  double sum = 0;
  for (int i = 0; i < kSlices; ++i)
    sum += std::max(reach_at(piece, side, kContactHeight, ((i + 0.5) / kSlices - 0.5) * kContactHeight), 0.0);
  return sum * kContactHeight / kSlices;
}

TEST(Contacts, BeadsThatReachEachOtherHoldWhatTheyAreMadeOf) {
  for (const double angle : {0.0, 0.4, 1.5707963267948966, -2.0}) {
    const auto pieces = rows_of_pieces({0, 0.40, 0.86}, {0.45, 0.40, 0.40}, angle);
    Buffer<PieceSides> sides;
    Buffer<PieceClearance> clearances;
    EXPECT_EQ(find_contacts(pieces, kContactHeight, sides, clearances), 0);
    const std::size_t first = 50, second = 150, third = 250;
    EXPECT_LT(sides[first].right.corner_mm, 0) << "nothing lies there";
    EXPECT_GE(sides[first].left.corner_mm, 0);
    EXPECT_LT(sides[third].right.corner_mm, 0) << "a gap of 0.06 mm";
    EXPECT_NEAR(sides[first].left.reach_mm + sides[second].right.reach_mm, 0.40, 1e-5);
    const double both =
        half_section_of(pieces[first], sides[first].left) + half_section_of(pieces[second], sides[second].right);
    EXPECT_NEAR(both, (pieces[first].area_mm2 + pieces[second].area_mm2) / 2, 1e-4);
  }
}

TEST(Contacts, FreeSidesAreThoseOfStadiaEllipsesAndCircles) {
  DepositedPiece piece{{0, 0}, {20'000, 0}, 0, 0};
  for (const double width : {0.5, 0.3}) {
    piece.width_mm = width;
    piece.area_mm2 = bead_area(width, kContactHeight);
    EXPECT_NEAR(2 * half_section_of(piece, {width / 2, -1}), piece.area_mm2, 1e-5);
  }
  piece.width_mm = 0.2;
  for (const double area : {std::numbers::pi / 4 * 0.2 * 0.3, std::numbers::pi / 4 * 0.2 * 0.2}) {
    piece.area_mm2 = area;
    EXPECT_NEAR(2 * half_section_of(piece, {0.1, -1}), area, 1e-5);
  }
}

/// A whole row is squeezed as that of neighbours.h.
TEST(Contacts, ARowHasTheSidesOfARow) {
  const std::vector<double> centres{0, 0.42, 0.86, 1.28}, widths{0.42, 0.47, 0.40, 0.50};
  const auto pieces = rows_of_pieces(centres, widths, 0);
  Buffer<PieceSides> sides;
  Buffer<PieceClearance> clearances;
  find_contacts(pieces, kContactHeight, sides, clearances);
  std::vector<AdjacentBead> row;
  for (std::size_t i = 0; i < centres.size(); ++i) row.push_back({centres[i], bead_area(widths[i], kContactHeight), widths[i]});
  Buffer<SqueezedBead> squeezed;
  squeeze(row, kContactHeight, 0, squeezed);
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const PieceSides& side = sides[100 * i + 50];
    EXPECT_NEAR(centres[i] + side.left.reach_mm, squeezed[i].right_mm, 1e-5);
    EXPECT_NEAR(centres[i] - side.right.reach_mm, squeezed[i].left_mm, 1e-5);
    if (!squeezed[i].touches_right) continue;
    const double corner = side.left.corner_mm;
    EXPECT_NEAR(4 * (1 - std::numbers::pi / 4) * corner * corner, squeezed[i].cusps_mm2, 1e-5);
  }
}

TEST(Contacts, WhatHasNoSpaceGoesToTheOtherSides) {
  const auto pieces = rows_of_pieces({0, 0.3}, {0.45, 0.45}, 0);
  const double area = bead_area(0.45, kContactHeight), over = area - 0.3 * kContactHeight;
  Buffer<PieceSides> sides;
  Buffer<PieceClearance> clearances;
  EXPECT_EQ(find_contacts(pieces, kContactHeight, sides, clearances), 0);
  EXPECT_EQ(sides[50].left.corner_mm, 0) << "no cusp is left";
  EXPECT_NEAR(sides[50].right.reach_mm, 0.225 + over / 2 / kContactHeight, 1e-6);
  // Between two others it has none at all.
  const auto crowded = rows_of_pieces({0, 0.3, 0.6}, {0.45, 0.45, 0.45}, 0);
  EXPECT_GT(find_contacts(crowded, kContactHeight, sides, clearances), 0);
}

TEST(Contacts, BeadsThatCrossAndTheOwnLineAreNoNeighbours) {
  Buffer<DepositedPiece> pieces = rows_of_pieces({0}, {0.5}, 0);
  for (const DepositedPiece& piece : rows_of_pieces({-1}, {0.5}, 1.5707963267948966)) pieces.push_back(piece);
  Buffer<PieceSides> sides;
  Buffer<PieceClearance> clearances;
  find_contacts(pieces, kContactHeight, sides, clearances);
  for (const PieceSides& side : sides) {
    EXPECT_LT(side.left.corner_mm, 0);
    EXPECT_LT(side.right.corner_mm, 0);
  }
  pieces.clear();
  EXPECT_EQ(find_contacts(pieces, kContactHeight, sides, clearances), 0);
}

}  // namespace
}  // namespace lamina::bead
