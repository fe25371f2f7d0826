// tests/load/test_winding.cpp: the winding number of closed and open surfaces, and the solid that is made of it.
#include "stages/load/winding/winding.h"

#include <oneapi/tbb/global_control.h>

#include "stages/load/repair/diagnose.h"
#include "tests/load/broken_files.h"

namespace lamina::test {
namespace {

TEST(Winding, IsOneInsideAndZeroOutside) {
  const Mesh mesh = mesh_of(ball(8, 32));
  const load::WindingTree tree({mesh.triangles.data(), mesh.triangles.size()}, {0, 0, 0});
  for (const double mm : {0.0, 3.0, 7.0, 7.9}) EXPECT_NEAR(tree.at({mm * 1e6, 0, 0}), 1, 0.03) << mm;
  for (const double mm : {8.1, 9.0, 12.0, 100.0}) EXPECT_NEAR(tree.at({0, mm * 1e6, 0}), 0, 0.03) << mm;
}

TEST(Winding, IsAHalfAtTheMiddleOfAHalvedBall) {
  Facets half;
  for (const FloatTriangle& f : ball(8, 32))
    if (f[2] <= 1e-3f && f[5] <= 1e-3f && f[8] <= 1e-3f) half.push_back(f);
  const Mesh mesh = mesh_of(half);
  const load::WindingTree tree({mesh.triangles.data(), mesh.triangles.size()}, {0, 0, 0});
  EXPECT_NEAR(tree.at({0, 0, 0}), 0.5, 0.02);
}

TEST(Remesh, GivesAClosedSolidOfTheSameVolumeForAnyThreads) {
  Random random(3);
  const Facets broken = without(jittered(ball(8, 16), random, 30), random, 0.05);
  std::vector<Buffer<Triangle>> results;
  for (const std::size_t threads : {1u, 4u}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    Mesh mesh = mesh_of(broken);
    load::remesh(mesh, 24);
    const load::Census found = load::census(mesh.triangles);
    EXPECT_TRUE(found.balanced);
    EXPECT_NEAR(found.volume_mm3, load::census(mesh_of(ball(8, 16)).triangles).volume_mm3, 100);
    results.push_back(std::move(mesh.triangles));
  }
  EXPECT_EQ(results[0], results[1]);
}

TEST(Remesh, IsAWayOfRepair) {
  load::LoadOptions options;
  options.winding = true;
  Facets open = unit_box();
  open.pop_back();
  const Part part = loaded(write_file("open.stl", binary_stl(open)), options);
  EXPECT_CONTAINS(notes_of(part), "approximate");
  EXPECT_NEAR(part.meshes[0].volume_mm3, 6000, 600);
  // A closed mesh stays what it is.
  EXPECT_EQ(placed(loaded(write_file("box.stl", binary_stl(unit_box())), options)),
            placed(loaded(write_file("plain.stl", binary_stl(unit_box())))));
}

}  // namespace
}  // namespace lamina::test
