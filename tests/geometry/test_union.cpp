// Unions of boxes on a grid, whose edges and corners coincide: every cell against its count of boxes.
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <random>
#include <string>

#include "stages/geometry/clipping.h"
#include "tests/slice/contour_laws.h"

namespace lamina {
namespace {

constexpr Nm kSide = 1000;
constexpr std::uint32_t kCells = 11;

struct GridBoxes {
  Contours contours;
  std::array<std::array<std::uint32_t, kCells>, kCells> boxes{};  // about each cell
};

GridBoxes some_boxes(std::mt19937& random, std::uint32_t count) {
  GridBoxes made;
  for (std::uint32_t b = 0; b < count; ++b) {
    const auto drawn = [&](std::uint32_t below) { return static_cast<std::uint32_t>(random() % below); };
    const std::uint32_t x = drawn(8), y = drawn(8), right = x + 1 + drawn(3), top = y + 1 + drawn(3);
    const auto corner = [](std::uint32_t i, std::uint32_t j) {
      return Point2{static_cast<Nm>(i) * kSide, static_cast<Nm>(j) * kSide};
    };
    made.contours.point.insert(made.contours.point.end(), {corner(x, y), corner(right, y), corner(right, top), corner(x, top)});
    made.contours.close();
    for (std::uint32_t i = x; i < right; ++i)
      for (std::uint32_t j = y; j < top; ++j) ++made.boxes[i][j];
  }
  return made;
}

TEST(Union, WindsOnceAboutWhatIsSolidAndNeverAboutTheRest) {
  std::mt19937 random(4);
  for (std::uint32_t k = 0; k < 150; ++k) {
    const GridBoxes given = some_boxes(random, 5 + k / 3);
    for (const FillRule rule : {FillRule::kNonzero, FillRule::kPositive, FillRule::kEvenOdd}) {
      for (const bool simple : {true, false}) {
        const auto region = contour_union(given.contours, rule, simple);
        ASSERT_TRUE(region.ok());
        for (std::uint32_t i = 0; i < kCells; ++i) {
          for (std::uint32_t j = 0; j < kCells; ++j) {
            const Point2 middle{static_cast<Nm>(i) * kSide + kSide / 2, static_cast<Nm>(j) * kSide + kSide / 2};
            const std::uint32_t boxes = given.boxes[i][j];
            const bool solid = rule == FillRule::kEvenOdd ? boxes % 2 == 1 : boxes > 0;
            ASSERT_EQ(test::winding_about(*region, middle), solid ? 1 : 0)
                << k << " cell " << i << " " << j << " rule " << static_cast<int>(rule) << (simple ? " simple" : "");
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace lamina
