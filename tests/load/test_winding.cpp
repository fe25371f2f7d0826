// tests/load/test_winding.cpp: the winding number of closed and open surfaces, and the solid that is made of it.
#include "stages/load/winding/winding.h"

#include <oneapi/tbb/global_control.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

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

TEST(Winding, OfALeafIsTheSumOfAllSolidAngles) {
  std::mt19937 numbers(7);
  const auto near = [&] { return static_cast<Nm>(numbers() % 2001) * 1000 - 1'000'000; };
  const auto point = [&] { return Point3{near(), near(), near()}; };
  using Vector = std::array<double, 3>;
  const auto dot = [](const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<Triangle> facets(1 + numbers() % 8);
    for (Triangle& t : facets) t = {point(), point(), point()};
    const Point3 from = trial % 10 == 0 ? facets[0].a : point();
    double angles = 0;
    for (const Triangle& t : facets) {
      std::array<Vector, 3> v{};
      for (std::size_t i = 0; const Point3& p : {t.a, t.b, t.c})
        v[i++] = {static_cast<double>(p.x - from.x), static_cast<double>(p.y - from.y), static_cast<double>(p.z - from.z)};
      const auto& [a, b, c] = v;
      const double la = std::sqrt(dot(a, a)), lb = std::sqrt(dot(b, b)), lc = std::sqrt(dot(c, c));
      const Vector n{b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]};
      angles += 2 * std::atan2(dot(a, n), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
    }
    const load::WindingTree tree(facets, {0, 0, 0});
    const double found =
        tree.at({static_cast<double>(from.x), static_cast<double>(from.y), static_cast<double>(from.z)}) - angles / (4 * M_PI);
    if (std::fabs(found) > 0.03) ADD_FAILURE() << trial << ": " << found << " of " << facets.size();
  }
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
