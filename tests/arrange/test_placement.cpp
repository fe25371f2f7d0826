// tests/arrange/test_placement.cpp: boxes in rows on the bed, or where they are wanted.
#include "stages/arrange/placement.h"

#include <gtest/gtest.h>

#include <random>

namespace lamina::arrange {
namespace {

std::vector<BoxPosition> placed(const std::vector<BoxRequest>& boxes, std::int64_t width, std::int64_t depth,
                                std::int64_t gap) {
  const auto positions = arrange_boxes(boxes, {width, depth}, gap);
  EXPECT_TRUE(positions.ok()) << positions.error().message;
  return positions.ok() ? *positions : std::vector<BoxPosition>{};
}

TEST(Placement, SinglePartIsInTheMiddleRoundedDown) {
  const auto positions = placed({{.width = 3, .depth = 4}}, 10, 10, 5);
  ASSERT_EQ(positions.size(), 1u);
  EXPECT_EQ(positions[0].x, 3);
  EXPECT_EQ(positions[0].y, 3);
}

TEST(Placement, PartAsLargeAsTheBedFitsAndOneNanometreMoreDoesNot) {
  EXPECT_TRUE(arrange_boxes(std::vector<BoxRequest>{{.width = 10, .depth = 10}}, {10, 10}, 5).ok());
  for (const auto& [width, depth] : {std::pair{11, 10}, {10, 11}}) {
    const auto positions =
        arrange_boxes(std::vector<BoxRequest>{{.width = width, .depth = depth, .name = "a.stl"}}, {10, 10}, 5);
    ASSERT_FALSE(positions.ok());
    EXPECT_EQ(positions.error().fault, Fault::kUsage);
    EXPECT_NE(positions.error().message.find("a.stl"), std::string::npos);
  }
}

TEST(Placement, RowsFillFromTheFrontLeftInOrder) {
  // Two fit next to each other with a gap of 1, so three make two rows, and the second row is behind the deeper box.
  const auto positions = placed({{.width = 4, .depth = 2}, {.width = 4, .depth = 3}, {.width = 2, .depth = 1}}, 9, 9, 1);
  ASSERT_EQ(positions.size(), 3u);
  EXPECT_EQ(positions[0].x, 0);
  EXPECT_EQ(positions[1].x, 5);
  EXPECT_EQ(positions[2].x, 0);
  EXPECT_EQ(positions[0].y, positions[1].y);
  EXPECT_EQ(positions[2].y, positions[0].y + 3 + 1);
  EXPECT_EQ(positions[0].y, (9 - 5) / 2);
}

TEST(Placement, CopiesOfAPositionFollowAlongX) {
  const auto positions = placed({{.width = 4, .depth = 2, .copies = 3, .at_x = 1, .at_y = 2}}, 17, 9, 2);
  ASSERT_EQ(positions.size(), 3u);
  for (std::int64_t i = 0; i < 3; ++i) {
    EXPECT_EQ(positions[i].x, 1 + 6 * i);
    EXPECT_EQ(positions[i].y, 2);
  }
  EXPECT_FALSE(
      arrange_boxes(std::vector<BoxRequest>{{.width = 4, .depth = 2, .copies = 3, .at_x = 2, .at_y = 2}}, {17, 9}, 2).ok());
}

TEST(Placement, ArrangedBoxesLieWithinTheBedAndAGapApart) {
  std::mt19937 random(3);
  for (int round = 0; round < 200; ++round) {
    std::vector<BoxRequest> boxes(1 + random() % 6);
    for (BoxRequest& box : boxes) {
      box.width = 1 + static_cast<std::int64_t>(random() % 40);
      box.depth = 1 + static_cast<std::int64_t>(random() % 40);
      box.copies = 1 + static_cast<std::uint32_t>(random() % 4);
    }
    const std::int64_t gap = random() % 5;
    const auto positions = arrange_boxes(boxes, {150, 200}, gap);
    if (!positions) continue;
    std::vector<std::size_t> count(boxes.size());
    for (std::size_t i = 0; i < positions->size(); ++i) {
      const BoxPosition& a = (*positions)[i];
      const BoxRequest& box = boxes[a.request];
      ++count[a.request];
      EXPECT_TRUE(a.x >= 0 && a.y >= 0 && a.x + box.width <= 150 && a.y + box.depth <= 200);
      for (std::size_t j = 0; j < i; ++j) {
        const BoxPosition& b = (*positions)[j];
        const BoxRequest& other = boxes[b.request];
        EXPECT_TRUE(a.x >= b.x + other.width + gap || b.x >= a.x + box.width + gap || a.y >= b.y + other.depth + gap ||
                    b.y >= a.y + box.depth + gap);
      }
    }
    for (std::size_t r = 0; r < boxes.size(); ++r) EXPECT_EQ(count[r], boxes[r].copies);
  }
}

TEST(Placement, NothingIsArrangedInTheMargin) {
  const std::vector<BoxRequest> five{{.width = 4, .depth = 3, .copies = 5}};
  const auto without = arrange_boxes(five, {20, 20, 0}, 0), with = arrange_boxes(five, {20, 20, 3}, 0);
  ASSERT_TRUE(without.ok() && with.ok());
  EXPECT_EQ(without->at(4).x, 16) << "a row of five";
  EXPECT_EQ(with->at(4).y, with->at(0).y + 3) << "rows of three";
  for (const BoxPosition& position : *with) {
    EXPECT_TRUE(position.x >= 3 && position.x + 4 <= 17 && position.y >= 3 && position.y + 3 <= 17);
  }
  const std::vector<BoxRequest> one{{.width = 14, .depth = 14, .name = "a.stl"}},
      larger{{.width = 15, .depth = 2, .name = "a.stl"}};
  EXPECT_TRUE(arrange_boxes(one, {20, 20, 3}, 0).ok());
  const auto refused = arrange_boxes(larger, {20, 20, 3'000'000}, 0), tight = arrange_boxes(larger, {20, 20, 3}, 0);
  ASSERT_FALSE(refused.ok() || tight.ok());
  EXPECT_NE(refused.error().message.find("without its margin of 3 mm; use a smaller --margin"), std::string::npos)
      << refused.error().message;
  EXPECT_FALSE(arrange_boxes(five, {20, 8, 3}, 0).ok()) << "one row of depth 2";
  EXPECT_TRUE(arrange_boxes(std::vector<BoxRequest>{{.width = 15, .depth = 2, .at_x = 0, .at_y = 0}}, {20, 20, 3}, 0).ok());
}

}  // namespace
}  // namespace lamina::arrange
