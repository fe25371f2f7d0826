// tests/load/test_shells.cpp: bodies that are inside out and overlap others are solid all the same.
#include <cmath>
#include <numbers>
#include <random>

#include "stages/data/runs.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/load/repair/shells.h"
#include "stages/raster/raster.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

/// Tenths of a millimetre.
struct GridBox {
  std::array<int, 3> lo, hi;

  bool holds(const std::array<double, 3>& p) const {
    for (std::size_t k = 0; k < 3; ++k)
      if (p[k] < lo[k] || p[k] > hi[k]) return false;
    return true;
  }
  std::vector<FloatTriangle> facets() const {
    std::array<float, 3> low{}, high{};
    for (std::size_t k = 0; k < 3; ++k) low[k] = static_cast<float>(lo[k]) / 10, high[k] = static_cast<float>(hi[k]) / 10;
    return box_facets(low, high);
  }
};

/// A box with a hollow.
struct HollowBody {
  GridBox outer, hollow;
  bool inverted;

  bool holds(const std::array<double, 3>& p) const { return outer.holds(p) && !hollow.holds(p); }
  void append(std::vector<FloatTriangle>& all) const {
    const auto add = [&](const GridBox& box, bool turned) {
      for (FloatTriangle facet : box.facets()) {
        if (turned) std::swap_ranges(facet.begin() + 3, facet.begin() + 6, facet.begin() + 6);
        all.push_back(facet);
      }
    };
    add(outer, inverted);
    add(hollow, !inverted);
  }
};

HollowBody random_body(std::mt19937& random) {
  const auto pick = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
  HollowBody body{};
  for (std::size_t k = 0; k < 3; ++k) {
    body.outer.lo[k] = pick(2, 24);
    body.outer.hi[k] = body.outer.lo[k] + pick(8, 22);
    body.hollow.lo[k] = pick(body.outer.lo[k] + 1, body.outer.hi[k] - 4);
    body.hollow.hi[k] = pick(body.hollow.lo[k] + 1, body.outer.hi[k] - 1);
  }
  body.inverted = random() % 2 == 0;
  return body;
}

bool contains_box(const GridBox& outer, const GridBox& inner) {
  for (std::size_t k = 0; k < 3; ++k)
    if (inner.lo[k] < outer.lo[k] || inner.hi[k] > outer.hi[k]) return false;
  return true;
}

bool overlaps(const HollowBody& a, const HollowBody& b) {
  for (std::size_t k = 0; k < 3; ++k)
    if (a.outer.hi[k] <= b.outer.lo[k] || b.outer.hi[k] <= a.outer.lo[k]) return false;
  return !contains_box(a.outer, b.outer) && !contains_box(b.outer, a.outer);
}

/// Pixels of 0.1 mm in layers of 0.1 mm, sampled in their middles.
std::uint64_t pixels_of(Mesh mesh) {
  const PixelGrid grid{{254, 5'000'000}, {254, 5'000'000}};
  const Instance instance{0, {0, 0, 0}};
  auto rasterizer = raster::Rasterizer::build({&mesh, 1}, {&instance, 1}, grid, FillRule::kNonzero, false, true);
  EXPECT_TRUE(rasterizer.ok());
  raster::LayerScratch scratch;
  Runs runs;
  std::uint64_t pixels = 0;
  for (Nm plane = 50'000; plane < 5'000'000; plane += 100'000) {
    rasterizer->layer(raster::Engine::kContours, plane, scratch, runs);
    for (std::size_t i = 0; i + 1 < runs.change.size(); i += 2) pixels += runs.change[i + 1] - runs.change[i];
  }
  return pixels;
}

TEST(Shells, TwoHollowBodiesThatOverlapAreTheirUnionWhicheverIsInsideOut) {
  std::mt19937 random(34);
  int made = 0, inverted = 0;
  while (made < 200) {
    const HollowBody one = random_body(random), other = random_body(random);
    if (!overlaps(one, other)) continue;
    ++made;
    inverted += one.inverted || other.inverted ? 1 : 0;
    std::vector<FloatTriangle> facets;
    one.append(facets), other.append(facets);
    std::uint64_t expected = 0;
    for (int x = 0; x < 50; ++x) {
      for (int y = 0; y < 50; ++y) {
        for (int z = 0; z < 50; ++z) {
          const std::array<double, 3> centre{x + 0.5, y + 0.5, z + 0.5};
          expected += one.holds(centre) || other.holds(centre) ? 1 : 0;
        }
      }
    }
    Part part = loaded(write_file("bodies.stl", binary_stl(facets)));
    ASSERT_EQ(pixels_of(std::move(part.meshes[0])), expected) << "position " << made;
  }
  EXPECT_GT(inverted, 100);
}

/// Facets of a sphere, mm.
std::vector<FloatTriangle> sphere_facets(const std::array<double, 3>& centre, double radius, int rings, bool turned) {
  const auto at = [&](int ring, int side) {
    const double u = std::numbers::pi * ring / rings, v = std::numbers::pi * side / rings;
    const double r = ring == 0 || ring == rings ? 0 : radius * std::sin(u);  // one pole, whatever the side
    return std::array<double, 3>{centre[0] + r * std::cos(v), centre[1] + r * std::sin(v), centre[2] - radius * std::cos(u)};
  };
  std::vector<FloatTriangle> facets;
  const auto add = [&](const std::array<double, 3>& a, const std::array<double, 3>& b, const std::array<double, 3>& c) {
    FloatTriangle facet{};
    const auto& second = turned ? c : b;
    const auto& third = turned ? b : c;
    for (std::size_t k = 0; k < 3; ++k) {
      facet[k] = static_cast<float>(a[k]);
      facet[3 + k] = static_cast<float>(second[k]);
      facet[6 + k] = static_cast<float>(third[k]);
    }
    facets.push_back(facet);
  };
  for (int ring = 0; ring < rings; ++ring) {
    for (int side = 0; side < 2 * rings; ++side) {
      const int next = (side + 1) % (2 * rings);
      if (ring > 0) add(at(ring, side), at(ring, next), at(ring + 1, side));
      if (ring + 1 < rings) add(at(ring, next), at(ring + 1, next), at(ring + 1, side));
    }
  }
  return facets;
}

double sphere_mm3(double radius) { return 4.0 / 3 * std::numbers::pi * radius * radius * radius; }

/// By list and by blocks.
std::array<Mesh, 2> by_list_and_blocks(const std::vector<FloatTriangle>& facets, std::size_t notes) {
  const std::string path = write_file("shells.stl", binary_stl(facets));
  load::LoadOptions options;
  Part list = loaded(path, options);
  options.blocks = true;
  Part blocks = loaded(path, options);
  EXPECT_EQ(list.notes.size(), notes);
  EXPECT_EQ(blocks.notes.size(), notes);
  EXPECT_EQ(list.meshes[0].fingerprint, blocks.meshes[0].fingerprint);
  return {list.meshes[0], blocks.meshes[0]};
}

std::vector<FloatTriangle> joined(std::vector<FloatTriangle> one, const std::vector<FloatTriangle>& other) {
  one.insert(one.end(), other.begin(), other.end());
  return one;
}

TEST(Shells, SpheresOfManyBlocksAreTurnedWithTheirHollows) {
  const auto sound = sphere_facets({20, 20, 20}, 12, 60, false);
  const auto overlapping = joined(sphere_facets({30, 20, 20}, 10, 60, true), sphere_facets({30, 21, 20}, 4, 40, false));
  for (const Mesh& mesh : by_list_and_blocks(joined(sound, overlapping), 1))
    EXPECT_NEAR(mesh.volume_mm3, sphere_mm3(12) + sphere_mm3(10) - sphere_mm3(4), 0.01 * sphere_mm3(12));
  const auto hollow = sphere_facets({20, 21, 20}, 8, 50, true);
  for (const Mesh& mesh : by_list_and_blocks(joined(sound, hollow), 0))
    EXPECT_NEAR(mesh.volume_mm3, sphere_mm3(12) - sphere_mm3(8), 0.01 * sphere_mm3(12));
  EXPECT_NE(by_list_and_blocks(joined(sound, hollow), 0)[1].blocks, nullptr) << "a hollow is sound";
  EXPECT_NE(by_list_and_blocks(sound, 0)[1].blocks, nullptr);
}

TEST(Shells, BodiesThatTouchAtACornerOrAnEdgeAreBodiesOfTheirOwn) {
  const GridBox base{{0, 0, 0}, {100, 100, 100}};
  for (const GridBox& other : {GridBox{{0, 0, 0}, {50, 50, 200}}, GridBox{{0, 0, -100}, {40, 100, 100}},
                               GridBox{{100, 100, 0}, {150, 150, 100}}, GridBox{{0, 0, 0}, {100, 50, 200}}}) {
    std::vector<FloatTriangle> turned = other.facets();
    for (FloatTriangle& facet : turned) std::swap_ranges(facet.begin() + 3, facet.begin() + 6, facet.begin() + 6);
    double expected = 0;
    for (const GridBox& box : {base, other})
      expected += (box.hi[0] - box.lo[0]) * (box.hi[1] - box.lo[1]) * (box.hi[2] - box.lo[2]) / 1000.0;
    for (const Mesh& mesh : by_list_and_blocks(joined(base.facets(), turned), 1)) EXPECT_NEAR(mesh.volume_mm3, expected, 1e-6 * expected);
  }
}

/// The facets of a box, each side as cells x cells squares, mm.
std::vector<FloatTriangle> divided_box(double lo, double hi, int cells, bool turned) {
  std::vector<FloatTriangle> facets;
  const auto at = [&](int i) { return lo + (hi - lo) * i / cells; };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const bool upper : {false, true}) {
      const auto corner = [&](int i, int j) {
        std::array<double, 3> p{};
        p[axis] = upper ? hi : lo, p[(axis + 1) % 3] = at(i), p[(axis + 2) % 3] = at(j);
        return p;
      };
      for (int i = 0; i < cells; ++i) {
        for (int j = 0; j < cells; ++j) {
          const std::array corners{corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)};
          for (const auto& [a, b, c] : {std::array<std::size_t, 3>{0, 1, 2}, {0, 2, 3}}) {
            const bool swap = upper == turned;
            FloatTriangle facet{};
            for (std::size_t k = 0; k < 3; ++k) {
              facet[k] = static_cast<float>(corners[a][k]);
              facet[3 + k] = static_cast<float>(corners[swap ? c : b][k]);
              facet[6 + k] = static_cast<float>(corners[swap ? b : c][k]);
            }
            facets.push_back(facet);
          }
        }
      }
    }
  }
  return facets;
}

TEST(Shells, BodiesOfSeveralBlocksThatShareOneVertexAreTurned) {
  // Squares of 0.5 mm on both: vertices of one lie on vertices of the other where the surfaces cross.
  const auto facets = joined(divided_box(0, 16, 32, false), divided_box(8, 20, 24, true));
  ASSERT_GT(facets.size(), 4096u);
  for (const Mesh& mesh : by_list_and_blocks(facets, 1)) EXPECT_NEAR(mesh.volume_mm3, 16 * 16 * 16 + 12 * 12 * 12, 1e-3);
}

TEST(Shells, StayAsTheyAreUnderOtherRules) {
  std::vector<FloatTriangle> facets = GridBox{{0, 0, 0}, {200, 200, 100}}.facets();
  for (FloatTriangle facet : GridBox{{150, 0, 0}, {250, 200, 100}}.facets()) {
    std::swap_ranges(facet.begin() + 3, facet.begin() + 6, facet.begin() + 6);
    facets.push_back(facet);
  }
  load::LoadOptions options;
  options.turn_shells = false;
  const Part part = loaded(write_file("as_is.stl", binary_stl(facets)), options);
  EXPECT_TRUE(part.notes.empty());
  EXPECT_NEAR(part.meshes[0].volume_mm3, 2000.0, 1e-6);
}

}  // namespace
}  // namespace lamina::test
