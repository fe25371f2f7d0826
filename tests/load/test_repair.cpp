// tests/load/test_repair.cpp: the census, the diagnosis, and what repair makes of broken meshes.
#include "stages/load/repair/repair.h"

#include <oneapi/tbb/global_control.h>

#include <map>
#include <random>

#include "stages/load/repair/diagnose.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

Mesh as_in_file(const std::string& path) {
  load::LoadOptions options;
  options.repair = false;
  Part part = loaded(path, options);
  return std::move(part.meshes[0]);
}

/// Balance, the slow and plain way.
bool balanced(const Buffer<Triangle>& triangles) {
  std::map<std::pair<Point3, Point3>, std::int64_t> edges;
  for (const Triangle& t : triangles) {
    for (const auto& [p, q] : {std::pair{t.a, t.b}, std::pair{t.b, t.c}, std::pair{t.c, t.a}}) {
      if (p < q) ++edges[{p, q}];
      if (q < p) --edges[{q, p}];
    }
  }
  return std::all_of(edges.begin(), edges.end(), [](const auto& edge) { return edge.second == 0; });
}

Buffer<Triangle> soup(std::mt19937& random, std::size_t count, Nm span) {
  Buffer<Triangle> triangles;
  const auto number = [&] { return static_cast<Nm>(random() % static_cast<std::uint32_t>(span)) - span / 2; };
  for (std::size_t i = 0; i < count; ++i) {
    const auto point = [&] { return Point3{number(), number(), number()}; };
    triangles.push_back({point(), point(), point()});
  }
  return triangles;
}

TEST(Census, DistinguishesClosedFromOpen) {
  Mesh mesh = mesh_of(unit_box());
  EXPECT_TRUE(load::census(mesh.triangles).balanced);
  mesh.triangles.pop_back();
  EXPECT_FALSE(load::census(mesh.triangles).balanced);
  EXPECT_TRUE(load::census({}).balanced);
}

TEST(Census, AgreesWithCountingOnRandomMeshes) {
  std::mt19937 random(3);
  int closed = 0;
  for (int i = 0; i < 3000; ++i) {
    const Buffer<Triangle> triangles = soup(random, 1 + random() % 4, 2);
    const bool expected = balanced(triangles);
    closed += expected;
    ASSERT_EQ(load::census(triangles).balanced, expected);
  }
  EXPECT_GT(closed, 100);
}

TEST(Census, FingerprintIgnoresOrderAndFirstCornerButNotOrientation) {
  Mesh mesh = mesh_of(unit_box());
  const std::uint64_t fingerprint = load::census(mesh.triangles).fingerprint;
  std::reverse(mesh.triangles.begin(), mesh.triangles.end());
  for (Triangle& t : mesh.triangles) t = {t.b, t.c, t.a};
  EXPECT_EQ(load::census(mesh.triangles).fingerprint, fingerprint);
  std::swap(mesh.triangles[3].a, mesh.triangles[3].b);
  EXPECT_NE(load::census(mesh.triangles).fingerprint, fingerprint);
}

TEST(Census, FingerprintDistinguishesASingleNanometre) {
  Mesh mesh = mesh_of(unit_box());
  const std::uint64_t fingerprint = load::census(mesh.triangles).fingerprint;
  for (Triangle& t : mesh.triangles) {
    for (Nm* number : {&t.a.x, &t.b.y, &t.c.z}) {
      *number += 1;
      EXPECT_NE(load::census(mesh.triangles).fingerprint, fingerprint);
      *number -= 1;
    }
  }
}

TEST(Diagnose, ACleanBoxHasNothingToSay) {
  const load::Diagnosis found = load::diagnose(mesh_of(unit_box()));
  EXPECT_EQ(found.triangles, 12u);
  EXPECT_EQ(found.vertices, 8u);
  EXPECT_EQ(found.edges, 18u);
  EXPECT_EQ(found.shells, 1u);
  EXPECT_EQ(found.inverted_shells, 0u);
  EXPECT_EQ(found.volume_mm3, 6000);
  EXPECT_TRUE(found.balanced);
  EXPECT_EQ(found.open_edges.count + found.non_manifold_edges.count + found.misoriented_edges.count +
                found.degenerate_facets.count + found.duplicate_facets.count,
            0u);
}

TEST(Diagnose, FindsEachKindOfFaultAndItsPosition) {
  std::vector<FloatTriangle> facets = unit_box();
  facets.pop_back();
  load::Diagnosis found = load::diagnose(mesh_of(facets));
  EXPECT_EQ(found.open_edges.count, 3u);
  EXPECT_EQ(found.open_edges.first.size(), 3u);
  EXPECT_FALSE(found.balanced);

  facets = unit_box();
  std::swap_ranges(facets[4].begin(), facets[4].begin() + 3, facets[4].begin() + 3);
  found = load::diagnose(mesh_of(facets), 2);
  EXPECT_EQ(found.misoriented_edges.count, 3u);
  EXPECT_EQ(found.misoriented_edges.first.size(), 2u);

  facets = unit_box();
  facets.push_back(facets[5]);
  found = load::diagnose(mesh_of(facets));
  EXPECT_EQ(found.duplicate_facets.count, 1u);
  EXPECT_EQ(found.duplicate_facets.first[0].triangle, 12u);
  EXPECT_EQ(found.non_manifold_edges.count, 3u);

  facets = unit_box();
  facets.push_back({0, 0, 0, 0, 0, 0, 10, 0, 0});
  found = load::diagnose(mesh_of(facets));
  EXPECT_EQ(found.degenerate_facets.count, 1u);
  EXPECT_EQ(found.degenerate_facets.first[0].triangle, 12u);
  EXPECT_TRUE(found.balanced);
  EXPECT_EQ(found.non_manifold_edges.count, 0u);

  facets = box_facets({0, 0, 0}, {10, 10, 10});
  for (FloatTriangle facet : box_facets({2, 2, 2}, {4, 4, 4})) {
    std::swap_ranges(facet.begin(), facet.begin() + 3, facet.begin() + 3);
    facets.push_back(facet);
  }
  found = load::diagnose(mesh_of(facets));
  EXPECT_EQ(found.shells, 2u);
  EXPECT_EQ(found.inverted_shells, 1u);
  EXPECT_EQ(found.volume_mm3, 992);
}

TEST(Diagnose, AgreesWithTheNumbersThatOtherToolsGive) {
  const load::Diagnosis holes = load::diagnose(as_in_file(corpus("broken/nist_holes_3pct.stl")));
  EXPECT_EQ(holes.open_edges.count, 611u);
  EXPECT_EQ(holes.shells, 1u);
  const load::Diagnosis flipped = load::diagnose(as_in_file(corpus("broken/nist_flipped_20pct.stl")));
  EXPECT_EQ(flipped.misoriented_edges.count, 3474u);
  const load::Diagnosis duplicates = load::diagnose(as_in_file(corpus("broken/nist_duplicate_facets.stl")));
  EXPECT_EQ(duplicates.non_manifold_edges.count, 3152u);
  EXPECT_EQ(duplicates.duplicate_facets.count, 1338u);
  const load::Diagnosis clean = load::diagnose(as_in_file(corpus("nist_am_test_artifact_v3b.stl")));
  EXPECT_TRUE(clean.balanced);
  EXPECT_NEAR(clean.volume_mm3, 100981, 0.5);
  const load::Diagnosis fin = load::diagnose(as_in_file(corpus("broken/extra_surface.stl")));
  EXPECT_EQ(fin.open_edges.count, 76u);
  EXPECT_EQ(fin.non_manifold_edges.count, 67u);
}

TEST(Repair, LeavesABalancedMeshUntouched) {
  Mesh mesh = mesh_of(unit_box());
  const Buffer<Triangle> before = mesh.triangles;
  const load::RepairReport report = load::repair(mesh, 5000);
  EXPECT_EQ(report.duplicates_dropped + report.facets_turned + report.vertices_welded + report.sheets_dropped +
                report.flat_dropped + report.openings_capped,
            0u);
  EXPECT_EQ(mesh.triangles, before);
  EXPECT_EQ(mesh.repaired_from, before.size());
}

TEST(Repair, BalancesAnyTriangleSoup) {
  std::mt19937 random(4);
  for (int i = 0; i < 1500; ++i) {
    Mesh mesh;
    // Few distinct vertices make edges with many facets; more make loose triangles.
    mesh.triangles = soup(random, 1 + random() % 60, static_cast<Nm>(2 + random() % 5));
    if (i % 5 == 0) mesh.triangles = soup(random, 1 + random() % 60, 2'000'000'000);
    load::repair(mesh, i % 3 == 0 ? 2 : 0);
    ASSERT_TRUE(balanced(mesh.triangles)) << i;
    ASSERT_TRUE(load::census(mesh.triangles).balanced) << i;
    ASSERT_LE(mesh.repaired_from, mesh.triangles.size());
  }
}

TEST(Repair, ASingleMissingTriangleComesBackExactly) {
  const Mesh clean = as_in_file(corpus("dental_crown.stl"));
  const std::vector<Triangle> expected = canonical(clean.triangles);
  for (std::size_t missing = 0; missing < clean.triangles.size(); missing += 97) {
    Mesh mesh;
    mesh.triangles = clean.triangles;
    mesh.triangles.erase(mesh.triangles.begin() + static_cast<std::ptrdiff_t>(missing));
    const load::RepairReport report = load::repair(mesh, 5000);
    EXPECT_EQ(report.openings_capped, 1u);
    EXPECT_EQ(report.cap_triangles, 1u);
    EXPECT_EQ(mesh.repaired_from, clean.triangles.size() - 1);
    ASSERT_EQ(canonical(mesh.triangles), expected) << missing;
  }
}

TEST(Repair, FacetsTurnedOverAtRandomComeBackExactly) {
  const Mesh clean = as_in_file(corpus("dental_crown.stl"));
  std::mt19937 random(5);
  for (int percent : {1, 10, 30}) {
    Mesh mesh;
    mesh.triangles = clean.triangles;
    for (Triangle& t : mesh.triangles)
      if (static_cast<int>(random() % 100) < percent) std::swap(t.b, t.c);
    load::repair(mesh, 5000);
    EXPECT_TRUE(canonical(mesh.triangles) == canonical(clean.triangles)) << percent;
  }
}

TEST(Repair, CornersMovedApartAreWeldedWithoutCaps) {
  Mesh mesh = as_in_file(corpus("broken/nist_unwelded_1um.stl"));
  const load::RepairReport report = load::repair(mesh, 5000);
  EXPECT_EQ(report.openings_capped, 0u);
  EXPECT_NEAR(load::diagnose(mesh).volume_mm3, 100981, 5);
}

TEST(Repair, CornersFarApartAreWeldedOverGrowingDistances) {
  const Mesh clean = as_in_file(corpus("dental_crown.stl"));
  for (const Nm off : {4'000, 20'000}) {
    std::mt19937 random(6);
    Mesh mesh;
    mesh.triangles = clean.triangles;
    mesh.bounds = clean.bounds;
    for (Triangle& t : mesh.triangles)
      for (Nm* x : {&t.a.x, &t.a.y, &t.a.z, &t.b.x, &t.b.y, &t.b.z, &t.c.x, &t.c.y, &t.c.z})
        *x += static_cast<Nm>(random() % static_cast<std::uint32_t>(2 * off)) - off;
    const load::RepairReport report = load::repair(mesh, {5'000, 160'000});
    EXPECT_GT(report.weld_nm, off);
    EXPECT_LE(report.weld_nm, 8 * off);
    EXPECT_NEAR(load::diagnose(mesh).volume_mm3, 526.449, 0.03 * 526.449) << off;
    EXPECT_LT(load::capped_share(mesh), 0.02) << off;
  }
}

TEST(Repair, TwoSidesOfAWallStayTwo) {
  // Two plates of 20 um with an open rim each way: their sides are nearer to each other than the distance.
  std::vector<FloatTriangle> facets = box_facets({0, 0, 0}, {10, 10, 0.02f});
  facets.resize(4);  // bottom and top alone
  Mesh mesh = mesh_of(facets);
  const load::RepairReport report = load::repair(mesh, {5'000, 160'000});
  EXPECT_EQ(report.vertices_welded, 0u);
}

TEST(Repair, LooseFacetsAreDroppedAndNotCapped) {
  std::vector<FloatTriangle> facets = unit_box();
  facets.push_back({20, 0, 0, 29, 0, 4, 20, 9, 2});
  Mesh mesh = mesh_of(facets);
  const load::RepairReport report = load::repair(mesh, 5000);
  EXPECT_EQ(report.flat_dropped, 1u);
  EXPECT_EQ(report.openings_capped, 0u);
  EXPECT_EQ(canonical(mesh.triangles), canonical(mesh_of(unit_box()).triangles));
}

TEST(Repair, WhatIsInsideOutIsTurnedOver) {
  std::vector<FloatTriangle> facets = unit_box();
  for (FloatTriangle& f : facets) std::swap_ranges(f.begin(), f.begin() + 3, f.begin() + 3);
  const Part part = loaded(write_file("inside_out.stl", binary_stl(facets)));
  const Part clean = loaded(write_file("clean.stl", binary_stl(unit_box())));
  EXPECT_EQ(placed(part), placed(clean));
  EXPECT_EQ(part.meshes[0].fingerprint, clean.meshes[0].fingerprint);
  EXPECT_NEAR(part.meshes[0].volume_mm3, 6000, 1e-6);
  EXPECT_CONTAINS(notes_of(part), "inside out");
}

TEST(Repair, WeldingDoesNotTouchFineEdges) {
  // A missing facet with sides of 2 um is put back, not drawn together.
  std::vector<FloatTriangle> facets = box_facets({0, 0, 0}, {0.002f, 0.002f, 0.002f});
  for (const FloatTriangle& f : box_facets({1, 1, 1}, {9, 9, 9})) facets.push_back(f);
  Mesh clean = mesh_of(facets);
  facets.erase(facets.begin());
  Mesh mesh = mesh_of(facets);
  const load::RepairReport report = load::repair(mesh, 5000);
  EXPECT_EQ(report.vertices_welded, 0u);
  EXPECT_EQ(canonical(mesh.triangles), canonical(clean.triangles));
}

TEST(Repair, AFinOnASolidIsDroppedAndAnOpenBoxNextToItIsCapped) {
  std::vector<FloatTriangle> facets = unit_box();
  const FloatTriangle fin{0, 0, 30, 10, 0, 30, 5, -5, 40};  // on the upper front edge
  facets.push_back(fin);
  Mesh mesh = mesh_of(facets);
  load::RepairReport report = load::repair(mesh, 5000);
  EXPECT_EQ(report.sheets_dropped, 1u);
  EXPECT_EQ(report.sheet_facets_dropped, 1u);
  EXPECT_EQ(mesh.bounds.hi.z, 30'000'000) << "the box is that of what is left";
  EXPECT_EQ(canonical(mesh.triangles), canonical(mesh_of(unit_box()).triangles));

  facets = unit_box();
  for (const FloatTriangle& f : box_facets({10, 0, 0}, {20, 20, 30})) facets.push_back(f);  // shares a face's edges
  const Mesh both = mesh_of(facets);
  facets.pop_back();
  Mesh open = mesh_of(facets);
  report = load::repair(open, 5000);
  EXPECT_EQ(report.sheets_dropped, 0u);
  EXPECT_EQ(report.openings_capped, 1u);
  EXPECT_EQ(canonical(open.triangles), canonical(both.triangles));
}

TEST(Repair, CapsAreFansFromTheSmallestVertex) {
  std::vector<FloatTriangle> facets = unit_box();
  facets.resize(10);  // without the face at x = 10
  Mesh mesh = mesh_of(facets);
  const load::RepairReport report = load::repair(mesh, 5000);
  EXPECT_EQ(report.openings_capped, 1u);
  ASSERT_EQ(mesh.triangles.size(), 12u);
  const Point3 smallest{10'000'000, 0, 0};
  EXPECT_EQ(mesh.triangles[10].a, smallest);
  EXPECT_EQ(mesh.triangles[11].a, smallest);
  EXPECT_EQ(load::diagnose(mesh).volume_mm3, 6000);
}

TEST(Repair, OpeningsThatTouchInAVertexStayApart) {
  std::vector<FloatTriangle> facets = unit_box();
  // Two facets on opposite sides of a corner: loops of three, not one of six.
  const Mesh clean = mesh_of(facets);
  facets.erase(facets.begin() + 4);
  facets.erase(facets.begin());
  Mesh mesh = mesh_of(facets);
  const load::RepairReport report = load::repair(mesh, 5000);
  EXPECT_TRUE(balanced(mesh.triangles));
  EXPECT_GE(report.openings_capped, 1u);
  EXPECT_EQ(mesh.triangles.size(), clean.triangles.size());
}

TEST(Repair, IsTheSameForOneAndEightThreads) {
  for (const char* file : {"broken/nist_holes_3pct.stl", "broken/nist_flipped_20pct.stl", "broken/nist_unwelded_1um.stl",
                           "broken/extra_surface.stl", "broken/nut_ascii_upper_crlf_tabs.stl", "quad_knot.obj"}) {
    std::vector<Buffer<Triangle>> results;
    for (const std::size_t threads : {1u, 2u, 8u}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      results.push_back(loaded(corpus(file)).meshes[0].triangles);
    }
    EXPECT_TRUE(results[0] == results[1] && results[0] == results[2]) << file;
  }
}

TEST(Repair, AWeldThatMayChangeTheVolumeIsReportedOrRequested) {
  // Of a plate of 100 x 100 mm and 12 facets, corners off by up to 80 um move four facets of half a side each.
  const std::vector<FloatTriangle> thin = box_facets({0, 0, 0}, {100, 100, 0.5f}), thick = box_facets({0, 0, 0}, {100, 100, 3});
  std::mt19937 random(1);
  const auto jittered = [&](std::vector<FloatTriangle> facets, float um) {
    for (FloatTriangle& f : facets)
      for (float& x : f) x += um * 1e-3f * (static_cast<float>(random() >> 8) / static_cast<float>(1 << 23) - 1);
    return write_file("jittered.stl", binary_stl(facets));
  };
  EXPECT_EQ(notes_of(loaded(jittered(thick, 4))).find("may be off"), std::string::npos);
  EXPECT_EQ(notes_of(loaded(jittered(thin, 1))).find("may be off"), std::string::npos);
  EXPECT_CONTAINS(notes_of(loaded(jittered(thick, 80))), "um: the volume may be off by");
  const std::string path = jittered(thin, 80), said = refusal(path);
  EXPECT_CONTAINS(said, "joining them may change its volume by");
  const std::size_t at = said.find("say --weld ");
  ASSERT_NE(at, said.npos) << said;
  load::LoadOptions options;
  options.weld_nm = std::stoll(said.substr(at + 11)) * 1000;
  const Part accepted = loaded(path, options);
  EXPECT_CONTAINS(notes_of(accepted), "the volume may be off by");
  EXPECT_NEAR(accepted.meshes[0].volume_mm3, 5000, 0.2 * 5000);
}

}  // namespace
}  // namespace lamina::test
