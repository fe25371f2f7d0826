// tests/load/test_transform.cpp: scale, rotation, shrink factors and units.
#include <cmath>

#include "stages/load/transform.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

constexpr std::array<double, 3> kOnes{1, 1, 1}, kZeros{0, 0, 0};

Part loaded_with(const load::Transform& transform, double unit_mm = 1) {
  load::LoadOptions options;
  options.transform = transform;
  options.unit_mm = unit_mm;
  return loaded(write_file("box.stl", binary_stl(unit_box())), options);
}

TEST(Transform, QuarterTurnsAreExact) {
  for (const double turns : {0.0, 360.0, -720.0})
    EXPECT_EQ(load::make_transform(kOnes, {turns, turns, turns}, kOnes).linear, load::Transform{}.linear);
  const auto about_z = load::make_transform(kOnes, {0, 0, 90}, kOnes);
  EXPECT_EQ(about_z.linear, (std::array<double, 9>{0, -1, 0, 1, 0, 0, 0, 0, 1}));
  EXPECT_EQ(load::make_transform(kOnes, {0, 0, 450}, kOnes).linear, about_z.linear);
  EXPECT_EQ(load::make_transform(kOnes, {0, 0, -270}, kOnes).linear, about_z.linear);
  EXPECT_EQ(load::make_transform(kOnes, {180, 0, 0}, kOnes).linear, (std::array<double, 9>{1, 0, 0, 0, -1, 0, 0, 0, -1}));
  const Box bounds = loaded_with(about_z).bounds;
  EXPECT_EQ(bounds.lo, (Point3{-20'000'000, 0, 0}));
  EXPECT_EQ(bounds.hi, (Point3{0, 10'000'000, 30'000'000}));
}

TEST(Transform, OrderIsScaleThenXThenYThenZThenShrink) {
  // x = 1 is scaled to 2, turned about z to y, and shrunk there.
  const auto transform = load::make_transform({2, 1, 1}, {0, 0, 90}, {10, 100, 1000});
  EXPECT_EQ(transform.linear, (std::array<double, 9>{0, -10, 0, 200, 0, 0, 0, 0, 1000}));
  // z is turned about x to -y, then about z to x.
  const auto two = load::make_transform(kOnes, {90, 0, 90}, kOnes);
  EXPECT_EQ(two.linear[2], 1);
  EXPECT_FALSE(two.mirrors());
}

TEST(Transform, OtherAnglesKeepLengths) {
  const auto transform = load::make_transform(kOnes, {10, 20, 30}, kOnes);
  const auto& m = transform.linear;
  for (std::size_t column = 0; column < 3; ++column)
    EXPECT_NEAR(m[column] * m[column] + m[3 + column] * m[3 + column] + m[6 + column] * m[6 + column], 1, 1e-15);
  EXPECT_FALSE(transform.mirrors());
}

TEST(Transform, MirroringKeepsTheInsideInside) {
  const auto transform = load::make_transform({-1, 1, 1}, kZeros, kOnes);
  EXPECT_TRUE(transform.mirrors());
  const Part part = loaded_with(transform);
  const Part expected = loaded(write_file("mirrored.stl", binary_stl(box_facets({-10, 0, 0}, {0, 20, 30}))));
  double volume = 0;
  for (const Triangle& t : part.meshes[0].triangles) {
    const auto x = [](const Point3& p) { return std::array<double, 3>{mm(p.x), mm(p.y), mm(p.z)}; };
    const auto a = x(t.a), b = x(t.b), c = x(t.c);
    volume += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  }
  EXPECT_NEAR(volume / 6, 6000, 1e-6);
  EXPECT_EQ(part.bounds.lo, expected.bounds.lo);
}

TEST(Transform, UnitsApplyBeforeTheTransform) {
  const Part part = loaded_with({}, 25.4);
  EXPECT_EQ(part.bounds.hi, (Point3{254'000'000, 508'000'000, 762'000'000}));
  load::Transform moved;
  moved.translation = {1, 0, 0};  // mm, not inches
  EXPECT_EQ(loaded_with(moved, 25.4).bounds.lo.x, 1'000'000);
}

TEST(Transform, BoundsAreThoseOfTheTransformedTriangles) {
  const Part part = loaded_with(load::make_transform({1, 2, 3}, {12, 34, 56}, {1.01, 0.99, 1}));
  Box bounds;
  for (const Triangle& t : part.meshes[0].triangles) bounds.add(t.a), bounds.add(t.b), bounds.add(t.c);
  EXPECT_EQ(part.bounds.lo, bounds.lo);
  EXPECT_EQ(part.bounds.hi, bounds.hi);
}

TEST(Transform, ClosedPartsStayClosedUnderAnyTransform) {
  load::LoadOptions options;
  for (int i = 1; i < 12; ++i) {
    options.transform = load::make_transform({1 + 0.01 * i, 1, 1}, {7.0 * i, 11.0 * i, 13.0 * i}, kOnes);
    const Part part = loaded(corpus("dental_crown.stl"), options);
    EXPECT_EQ(part.meshes[0].triangles.size(), 3878u);
    EXPECT_TRUE(part.notes.empty()) << notes_of(part);
  }
}

TEST(Snapper, RoundsLikeLlroundUpToTheReach) {
  const load::Snapper snapper({}, 1.0);
  const auto snap = [&](double x, Point3& out) { return snapper.snap(x, 0, 0, out); };
  Point3 out{};
  for (const double nm : {0.5, -0.5, 1.5, 2.5, -2.5, 0.49999999999999994, 2147483646.5, 2147483647.0, -2147483647.49}) {
    const double mm_value = nm / 1e6;
    ASSERT_EQ(snap(mm_value, out), load::Snapped::kYes) << nm;
    EXPECT_EQ(out.x, std::llround(mm_value * 1e6)) << nm;
  }
  EXPECT_EQ(snap(2147.4837, out), load::Snapped::kBeyondReach);
  EXPECT_EQ(snap(-2147.4837, out), load::Snapped::kBeyondReach);
  EXPECT_EQ(snap(1e308, out), load::Snapped::kBeyondReach);
  EXPECT_EQ(snap(NAN, out), load::Snapped::kNotFinite);
}

TEST(Hint, SmallPartsNeedTheirUnit) {
  const auto hint = [](float size) {
    return notes_of(loaded(write_file("small.stl", binary_stl(box_facets({0, 0, 0}, {size, size, size})))));
  };
  EXPECT_CONTAINS(hint(0.5f), "is the unit right?");
  EXPECT_CONTAINS(hint(5.0f), "--unit inch");
  EXPECT_EQ(hint(11.0f), "");
}

TEST(Extent, NothingToPrintIsRefused) {
  EXPECT_CONTAINS(refusal(write_file("flat.stl", binary_stl(box_facets({0, 0, 1}, {2, 2, 1})))),
                  "has no height: nothing to print");
  EXPECT_CONTAINS(refusal(write_file("flat.stl", binary_stl(box_facets({0, 0, 0}, {2, 0, 1})))), "has no depth");
  EXPECT_CONTAINS(refusal(write_file("line.stl", binary_stl({{0, 0, 0, 1, 1, 1, 2, 2, 2}}))), "all facets are degenerate");
}

}  // namespace
}  // namespace lamina::test
