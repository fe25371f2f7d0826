#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <memory>
#include <thread>

#include "pipeline/plan/scene.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/load/part_store.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

using test::Directory;

Box box_of(const Scene& scene, std::size_t instance) {
  const Instance& i = scene.instances[instance];
  Box box;
  for (const Triangle& t : scene.meshes[i.mesh].triangles) {
    for (const Point3& p : {t.a, t.b, t.c}) box.add(Point3{p.x + i.offset.x, p.y + i.offset.y, p.z + i.offset.z});
  }
  return box;
}

Scene loaded(const Job& job) {
  auto scene = load_scene(job, bare_bed(job));
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

TEST(Scene, PartsArePlacedAsRequestedWhereverTheirFilePutsThem) {
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

TEST(Scene, OfManyOverlapsAtOnePositionEachPartHasAFewNotes) {
  const Directory directory;
  test::write_box(directory / "a.stl", {0, 0, 0}, {10, 10, 10});
  Job job;
  job.parts.assign(500, {.path = directory / "a.stl", .at_mm = {{5, 5}}});
  const Scene scene = loaded(job);
  EXPECT_EQ(scene.parts[0].notes.size(), 0u);
  EXPECT_EQ(scene.parts[1].notes.size(), 1u);
  for (std::size_t part = 4; part < scene.parts.size(); ++part) {
    EXPECT_EQ(scene.parts[part].notes.size(), 4u) << part;  // three others, and that there are more
  }
}

TEST(Scene, OverlapsOfRequestedPositionsAreNoted) {
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

TEST(Scene, PartsThatJobsShareStayWhereTheirFileHasThem) {
  const Directory directory;
  test::write_box(directory / "far.stl", {-1500, 0, 0}, {-1490, 10, 10});
  std::this_thread::sleep_for(std::chrono::milliseconds(130));  // a file that was written just now is not stored
  Job job;
  job.bed_mm = {2000, 2000};
  job.loaded = std::make_shared<load::PartStore>(1u << 20);
  for (const double x : {1900.0, 1900.0, 0.0}) {  // farther from the file's position than 32 bits of nanometres, and nearer
    job.parts = {{.path = directory / "far.stl", .at_mm = {{x, 0}}}};
    const auto scene = load_scene(job, bare_bed(job), MeshForm::kBlocks);
    ASSERT_TRUE(scene.ok()) << scene.error().message;
    const Mesh& mesh = scene->meshes[0];
    EXPECT_EQ(mesh.blocks == nullptr, x > 0);
    Box box;
    each_vertex(mesh, [&](const Point3& p) { box.add(p); });
    EXPECT_EQ(box.lo, mesh.bounds.lo) << x;
    EXPECT_EQ(std::int64_t{box.lo.x} + scene->instances[0].offset.x, std::llround(x * 1e6));
  }
  EXPECT_EQ(job.loaded->hits(), 2u);
}

TEST(Scene, FlatPartIsRefusedAsInput) {
  const Directory directory;
  test::write_box(directory / "flat.stl", {0, 0, 1}, {10, 10, 1});
  Job job;
  job.parts = {{.path = directory / "flat.stl"}};
  const auto scene = load_scene(job, bare_bed(job));
  ASSERT_FALSE(scene.ok());
  EXPECT_EQ(scene.error().fault, Fault::kInput);
}

TEST(Scene, PartHigherThanTheReachIsRefused) {
  const Directory directory;
  test::write_box(directory / "a.stl", {0, 0, 0}, {1, 1, 10});
  Job job;
  job.parts = {{.path = directory / "a.stl", .bottom_mm = 2140}};
  const auto scene = load_scene(job, bare_bed(job));
  ASSERT_FALSE(scene.ok());
  EXPECT_EQ(scene.error().fault, Fault::kUsage);
}

}  // namespace
}  // namespace lamina::pipeline
