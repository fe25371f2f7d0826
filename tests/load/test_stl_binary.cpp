// tests/load/test_stl_binary.cpp: binary STL, regardless of its header.
#include <cmath>
#include <random>

#include "stages/load/repair/diagnose.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

TEST(ReadBinaryStl, ABoxIsTwelveTrianglesInNanometres) {
  const Part part = loaded(write_file("box.stl", binary_stl(unit_box())));
  ASSERT_EQ(part.meshes.size(), 1u);
  EXPECT_EQ(part.meshes[0].triangles.size(), 12u);
  EXPECT_EQ(part.bounds.lo, (Point3{0, 0, 0}));
  EXPECT_EQ(part.bounds.hi, (Point3{10'000'000, 20'000'000, 30'000'000}));
  EXPECT_TRUE(part.notes.empty()) << notes_of(part);
  EXPECT_EQ(part.meshes[0].repaired_from, 12u);
}

TEST(ReadBinaryStl, VerticesAreRoundedLikeLlroundForEveryKindOfFloat) {
  std::mt19937 random(1);
  std::vector<FloatTriangle> facets;
  std::vector<float> special{0.0f,        -0.0f,  5e-7f,   -5e-7f,     4.9999997e-7f, 1.5e-6f,    -2.5e-6f, 2147.4836f,
                             -2147.4836f, 1e-30f, -1e-42f, 0.0000005f, 1.0000005f,    1073.7418f, 0.1f,     123.456f};
  const auto next = [&]() -> float {
    if (random() % 4 == 0) return special[random() % special.size()];
    const float scale = std::ldexp(1.0f, static_cast<int>(random() % 40) - 29);
    return scale * std::uniform_real_distribution<float>(-0.9999f, 0.9999f)(random);
  };
  for (int i = 0; i < 20'000; ++i) {
    FloatTriangle facet;
    for (float& number : facet) number = next();
    facets.push_back(facet);
  }
  load::LoadOptions options;
  options.repair = false;
  const Part part = loaded(write_file("round.stl", binary_stl(facets)), options);
  ASSERT_EQ(part.meshes[0].triangles.size(), facets.size());
  Box bounds;
  for (std::size_t i = 0; i < facets.size(); ++i) {
    std::array<Nm, 9> got;
    std::memcpy(got.data(), &part.meshes[0].triangles[i], 36);
    for (std::size_t k = 0; k < 9; ++k)
      ASSERT_EQ(got[k], std::llround(static_cast<double>(facets[i][k]) * 1e6)) << facets[i][k];
    for (const Point3& p : {part.meshes[0].triangles[i].a, part.meshes[0].triangles[i].b, part.meshes[0].triangles[i].c})
      bounds.add(p);
  }
  EXPECT_EQ(part.bounds.lo, bounds.lo);
  EXPECT_EQ(part.bounds.hi, bounds.hi);
}

TEST(ReadBinaryStl, BoundsAreExactForEveryNumberOfFacets) {
  // Strips of facets are handled together; the last one is shorter. All lengths around the strips' are tried.
  std::vector<FloatTriangle> facets;
  std::mt19937 random(2);
  for (int i = 0; i < 530; ++i) {
    FloatTriangle facet;
    for (std::size_t k = 0; k < 9; ++k)  // axes that cannot be mistaken for each other
      facet[k] = std::uniform_real_distribution<float>(1, 9)(random) * std::array{1.0f, 10.0f, -100.0f}[k % 3];
    facets.push_back(facet);
  }
  load::LoadOptions options;
  options.repair = false;
  for (const std::size_t count : {1, 2, 3, 4, 5, 7, 255, 256, 257, 259, 511, 512, 513, 530}) {
    const Part part =
        loaded(write_file("n.stl", binary_stl({facets.begin(), facets.begin() + static_cast<std::ptrdiff_t>(count)})), options);
    Box bounds;
    for (const Triangle& t : part.meshes[0].triangles) bounds.add(t.a), bounds.add(t.b), bounds.add(t.c);
    EXPECT_EQ(part.bounds.lo, bounds.lo) << count;
    EXPECT_EQ(part.bounds.hi, bounds.hi) << count;
  }
}

TEST(ReadBinaryStl, FileWhoseHeaderSaysSolidIsStillBinary) {
  const Part plain = loaded(write_file("plain.stl", binary_stl(unit_box())));
  for (const char* header : {"solid", "solid thing\nfacet normal 0 0 1\nouter loop", "SOLID\r\n", "# v f", "PK"}) {
    const Part part = loaded(write_file("solid.stl", binary_stl(unit_box(), header)));
    EXPECT_EQ(placed(part), placed(plain)) << header;
  }
}

TEST(ReadBinaryStl, NameDoesNotDecide) {
  EXPECT_EQ(placed(loaded(write_file("box.obj", binary_stl(unit_box())))),
            placed(loaded(write_file("box2.stl", binary_stl(unit_box())))));
  EXPECT_EQ(loaded(write_file("noname", binary_stl(unit_box()))).meshes[0].triangles.size(), 12u);
}

TEST(ReadBinaryStl, StrayBytesAreNoted) {
  const Part part = loaded(write_file("stray.stl", binary_stl(unit_box()) + std::string(777, 'x')));
  EXPECT_EQ(part.meshes[0].triangles.size(), 12u);
  EXPECT_CONTAINS(notes_of(part), "777 stray bytes");
}

TEST(ReadBinaryStl, CountOfZeroMeansAllIfTheFileHoldsWholeFacets) {
  EXPECT_CONTAINS(notes_of(loaded(write_file("zero.stl", binary_stl(unit_box(), "", 0)))), "the header says 0 facets");
  EXPECT_CONTAINS(refusal(write_file("zero.stl", binary_stl(unit_box(), "", 0) + "x")), "holds no facets");
  EXPECT_CONTAINS(refusal(write_file("none.stl", binary_stl({}))), "holds no facets");
}

TEST(ReadBinaryStl, TooHighACountIsAcceptedOnlyIfTheFacetsClose) {
  EXPECT_CONTAINS(notes_of(loaded(write_file("high.stl", binary_stl(unit_box(), "", 20)))), "which close");
  std::vector<FloatTriangle> open = unit_box();
  open.pop_back();
  EXPECT_CONTAINS(refusal(write_file("high.stl", binary_stl(open, "", 12))), "cut short");
}

TEST(ReadBinaryStl, TruncatedAtEveryLengthIsRefused) {
  const std::string whole = binary_stl(unit_box());
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const std::string message = refusal(write_file("cut.stl", whole.substr(0, length)));
    ASSERT_FALSE(message.empty()) << length;
  }
}

TEST(ReadBinaryStl, HeaderThatClaimsFourBillionFacetsAllocatesNothingForThem) {
  EXPECT_CONTAINS(refusal(write_file("lie.stl", binary_stl(unit_box(), "", 0xffffffff) + "x")),
                  "header says 4294967295 facets");
}

TEST(ReadBinaryStl, NotFiniteCoordinateIsNamedByFacetAndByte) {
  for (const float bad : {NAN, -NAN, INFINITY, -INFINITY}) {
    for (const std::size_t at : {0u, 4u, 8u}) {
      std::vector<FloatTriangle> facets = unit_box();
      facets[7][at] = bad;
      const std::string path = write_file("nan.stl", binary_stl(facets));
      EXPECT_CONTAINS(refusal(path), "facet 8 (byte 434): a coordinate is not finite");
    }
  }
}

TEST(ReadBinaryStl, DropBadLeavesTheFacetOutAndRepairPutsItBack) {
  std::vector<FloatTriangle> facets = unit_box();
  facets[7][3] = NAN;
  load::LoadOptions options;
  options.drop_bad = true;
  const Part part = loaded(write_file("nan.stl", binary_stl(facets)), options);
  EXPECT_CONTAINS(notes_of(part), "1 facet with coordinates that are not finite dropped, the first is facet 8");
  EXPECT_EQ(placed(part), placed(loaded(write_file("box.stl", binary_stl(unit_box())))));
  options.repair = false;
  const Part open = loaded(write_file("nan.stl", binary_stl(facets)), options);
  EXPECT_EQ(open.meshes[0].triangles.size(), 11u);
  EXPECT_CONTAINS(notes_of(open), "not closed");
  facets.assign(3, FloatTriangle{NAN});
  EXPECT_CONTAINS(refusal(write_file("allnan.stl", binary_stl(facets)), options), "holds no facets");
}

TEST(ReadBinaryStl, CoordinateBeyondReachIsRefusedEvenWithDropBad) {
  std::vector<FloatTriangle> facets = unit_box();
  load::LoadOptions options;
  options.drop_bad = true;
  for (const float far : {2147.4838f, -2147.4838f, 1e30f}) {
    facets[2][5] = far;
    EXPECT_CONTAINS(refusal(write_file("far.stl", binary_stl(facets)), options),
                    "facet 3 (byte 184): a coordinate is beyond the reach");
  }
}

TEST(ReadBinaryStl, LimitOfTrianglesIsKept) {
  load::LoadOptions options;
  options.triangle_limit = 11;
  EXPECT_CONTAINS(refusal(write_file("box.stl", binary_stl(unit_box())), options), "more than the limit of 11");
}

TEST(ReadBinaryStl, ManyBlocksKeepTheFilesOrder) {
  std::vector<FloatTriangle> facets;
  for (int i = 0; i < 20'000; ++i) {
    const float x = static_cast<float>(i) / 64;
    facets.push_back({x, 0, 0, x + 1, 0, 0, x, 1, 1});
  }
  load::LoadOptions options;
  options.repair = false;
  const Part part = loaded(write_file("many.stl", binary_stl(facets)), options);
  for (std::size_t i = 0; i < facets.size(); ++i)
    ASSERT_EQ(part.meshes[0].triangles[i].a.x, std::llround(static_cast<double>(i) / 64 * 1e6));
}

}  // namespace
}  // namespace lamina::test
