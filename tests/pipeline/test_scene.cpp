#include <gtest/gtest.h>

#include <random>

#include "pipeline/plan/scene.h"
#include "stages/arrange/placement.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

using test::Directory;

std::vector<Place> placed(const std::vector<BoxRequest>& boxes, std::int64_t width, std::int64_t depth, std::int64_t gap) {
  const auto places = place_boxes(boxes, width, depth, gap);
  EXPECT_TRUE(places.ok()) << places.error().message;
  return places.ok() ? *places : std::vector<Place>{};
}

TEST(Placement, SinglePartStandsInTheMiddleRoundedDown) {
  const auto places = placed({{.width = 3, .depth = 4}}, 10, 10, 5);
  ASSERT_EQ(places.size(), 1u);
  EXPECT_EQ(places[0].x, 3);
  EXPECT_EQ(places[0].y, 3);
}

TEST(Placement, PartAsLargeAsTheBedFitsAndOneNanometreMoreDoesNot) {
  EXPECT_TRUE(place_boxes(std::vector<BoxRequest>{{.width = 10, .depth = 10}}, 10, 10, 5).ok());
  for (const auto& [width, depth] : {std::pair{11, 10}, {10, 11}}) {
    const auto places = place_boxes(std::vector<BoxRequest>{{.width = width, .depth = depth, .name = "a.stl"}}, 10, 10, 5);
    ASSERT_FALSE(places.ok());
    EXPECT_EQ(places.error().fault, Fault::kUsage);
    EXPECT_NE(places.error().message.find("a.stl"), std::string::npos);
  }
}

TEST(Placement, RowsFillFromTheFrontLeftInOrder) {
  // Two fit beside each other with a gap of 1, so three make two rows, and the second row stands behind the deeper box.
  const auto places = placed({{.width = 4, .depth = 2}, {.width = 4, .depth = 3}, {.width = 2, .depth = 1}}, 9, 9, 1);
  ASSERT_EQ(places.size(), 3u);
  EXPECT_EQ(places[0].x, 0);
  EXPECT_EQ(places[1].x, 5);
  EXPECT_EQ(places[2].x, 0);
  EXPECT_EQ(places[0].y, places[1].y);
  EXPECT_EQ(places[2].y, places[0].y + 3 + 1);
  EXPECT_EQ(places[0].y, (9 - 5) / 2);
}

TEST(Placement, CopiesOfAPositionFollowAlongX) {
  const auto places = placed({{.width = 4, .depth = 2, .copies = 3, .at_x = 1, .at_y = 2}}, 17, 9, 2);
  ASSERT_EQ(places.size(), 3u);
  for (std::int64_t i = 0; i < 3; ++i) {
    EXPECT_EQ(places[i].x, 1 + 6 * i);
    EXPECT_EQ(places[i].y, 2);
  }
  EXPECT_FALSE(
      place_boxes(std::vector<BoxRequest>{{.width = 4, .depth = 2, .copies = 3, .at_x = 2, .at_y = 2}}, 17, 9, 2).ok());
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
    const auto places = place_boxes(boxes, 150, 200, gap);
    if (!places) continue;
    std::vector<std::size_t> count(boxes.size());
    for (std::size_t i = 0; i < places->size(); ++i) {
      const Place& a = (*places)[i];
      const BoxRequest& box = boxes[a.request];
      ++count[a.request];
      EXPECT_TRUE(a.x >= 0 && a.y >= 0 && a.x + box.width <= 150 && a.y + box.depth <= 200);
      for (std::size_t j = 0; j < i; ++j) {
        const Place& b = (*places)[j];
        const BoxRequest& other = boxes[b.request];
        EXPECT_TRUE(a.x >= b.x + other.width + gap || b.x >= a.x + box.width + gap || a.y >= b.y + other.depth + gap ||
                    b.y >= a.y + box.depth + gap);
      }
    }
    for (std::size_t r = 0; r < boxes.size(); ++r) EXPECT_EQ(count[r], boxes[r].copies);
  }
}

Box box_of(const Scene& scene, std::size_t instance) {
  const Instance& i = scene.instances[instance];
  Box box;
  for (const Triangle& t : scene.meshes[i.mesh].triangles) {
    for (const Point3& p : {t.a, t.b, t.c}) box.add(Point3{p.x + i.offset.x, p.y + i.offset.y, p.z + i.offset.z});
  }
  return box;
}

Scene loaded(const Job& job) {
  auto scene = load_scene(job);
  EXPECT_TRUE(scene.ok()) << scene.error().message;
  return scene.ok() ? std::move(*scene) : Scene{};
}

TEST(Scene, EqualFilesWithEqualTransformsAreLoadedOnce) {
  const Directory directory;
  test::write_box(directory / "a.stl", {0, 0, 0}, {10, 20, 5});
  Job job;
  job.parts = {{.path = directory / "a.stl", .copies = 3},
               {.path = directory / "./a.stl"},
               {.path = directory / "a.stl", .scale = {2, 2, 2}}};
  const Scene scene = loaded(job);
  EXPECT_EQ(scene.meshes.size(), 2u);
  ASSERT_EQ(scene.instances.size(), 5u);
  EXPECT_EQ(scene.part_of_instance, (std::vector<std::uint32_t>{0, 0, 0, 1, 2}));
  EXPECT_EQ(scene.height, 10'000'000);
  EXPECT_EQ(scene.parts[0].triangles, 12u);
  EXPECT_EQ(scene.parts[0].fingerprint, scene.parts[1].fingerprint);
  EXPECT_NE(scene.parts[0].fingerprint, scene.parts[2].fingerprint);
}

TEST(Scene, PartsStandWhereAskedWhereverTheirFilePutsThem) {
  const Directory directory;
  for (const float origin : {0.f, -300.f, 1500.f, -2000.f, 2000.f}) {
    test::write_box(directory / "a.stl", {origin, -origin, origin}, {origin + 8, -origin + 16, origin + 4});
    Job job;
    job.parts = {{.path = directory / "a.stl", .copies = 2, .at_mm = {{7, 9}}, .bottom_mm = 3}};
    job.bed_mm = {2147, 2147};
    const Scene scene = loaded(job);
    ASSERT_EQ(scene.instances.size(), 2u);
    EXPECT_EQ(box_of(scene, 0).lo, (Point3{7'000'000, 9'000'000, 3'000'000})) << origin;
    EXPECT_EQ(box_of(scene, 0).hi, (Point3{15'000'000, 25'000'000, 7'000'000})) << origin;
    EXPECT_EQ(box_of(scene, 1).lo, (Point3{20'000'000, 9'000'000, 3'000'000})) << origin;
    EXPECT_EQ(scene.parts[0].bounds.lo, box_of(scene, 0).lo);
    EXPECT_EQ(scene.height, 7'000'000);
  }
}

TEST(Scene, FarAwayPartReachesTheFarCornerWithoutOverflow) {
  // The way from -2000 mm to +2140 mm does not fit into 32 bits of nanometres.
  const Directory directory;
  test::write_box(directory / "a.stl", {-2000, -2000, -2000}, {-1999, -1999, -1999});
  Job job;
  job.bed_mm = {2147, 2147};
  job.gap_mm = 0;
  job.parts = {{.path = directory / "a.stl", .at_mm = {{100, 100}}},
               {.path = directory / "a.stl", .copies = 2, .at_mm = {{2140, 2146}}}};
  const Scene scene = loaded(job);
  ASSERT_EQ(scene.instances.size(), 3u);
  EXPECT_EQ(box_of(scene, 0).lo, (Point3{100'000'000, 100'000'000, 0}));
  EXPECT_EQ(box_of(scene, 1).lo, (Point3{2'140'000'000, 2'146'000'000, 0}));
  EXPECT_EQ(box_of(scene, 2).lo, (Point3{2'141'000'000, 2'146'000'000, 0}));
}

TEST(Scene, OverlapsOfAskedPositionsAreNoted) {
  const Directory directory;
  test::write_box(directory / "a.stl", {0, 0, 0}, {10, 10, 10});
  Job job;
  job.parts = {{.path = directory / "a.stl", .at_mm = {{0, 0}}}, {.path = directory / "a.stl", .at_mm = {{9, 9}}}};
  Scene scene = loaded(job);
  ASSERT_EQ(scene.parts[1].notes.size(), 1u);
  EXPECT_NE(scene.parts[1].notes[0].text.find("overlaps"), std::string::npos);
  job.parts[1].at_mm = {10, 0};  // faces touch
  EXPECT_TRUE(loaded(job).parts[1].notes.empty());
  job.parts[1].at_mm = {0, 0};
  job.parts[1].bottom_mm = 10;  // one above the other
  EXPECT_TRUE(loaded(job).parts[1].notes.empty());
}

TEST(Scene, FlatPartIsRefusedAsInput) {
  const Directory directory;
  test::write_box(directory / "flat.stl", {0, 0, 1}, {10, 10, 1});
  Job job;
  job.parts = {{.path = directory / "flat.stl"}};
  const auto scene = load_scene(job);
  ASSERT_FALSE(scene.ok());
  EXPECT_EQ(scene.error().fault, Fault::kInput);
}

TEST(Scene, PartHigherThanTheReachIsRefused) {
  const Directory directory;
  test::write_box(directory / "a.stl", {0, 0, 0}, {1, 1, 10});
  Job job;
  job.parts = {{.path = directory / "a.stl", .bottom_mm = 2140}};
  const auto scene = load_scene(job);
  ASSERT_FALSE(scene.ok());
  EXPECT_EQ(scene.error().fault, Fault::kUsage);
}

}  // namespace
}  // namespace lamina::pipeline
