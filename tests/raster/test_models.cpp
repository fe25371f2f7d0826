// Both engines against the contract on real parts: every file of the corpus, and of the folder LAMINA_MODELS names.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "stages/load/load.h"
#include "stages/raster/raster.h"
#include "tests/load/files.h"
#include "tests/raster/reference.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using raster::Engine;

/// All facets of a part where they stand, lowest corner of the box at `origin`.
std::vector<Triangle> facets_at(const Part& part, const Point3& origin) {
  std::vector<Triangle> all;
  const Point3 move{origin.x - part.bounds.lo.x, origin.y - part.bounds.lo.y, origin.z - part.bounds.lo.z};
  for (const Instance& instance : part.instances) {
    for (Triangle t : part.meshes[instance.mesh].triangles) {
      for (Point3* p : {&t.a, &t.b, &t.c}) {
        *p = {p->x + instance.offset.x + move.x, p->y + instance.offset.y + move.y, p->z + instance.offset.z + move.z};
      }
      all.push_back(t);
    }
  }
  return all;
}

/// At least 12 heights: the first and the last layer, planes exactly through the largest flat faces and 1 nm off
/// them, exactly through corners, and evenly spread ones.
std::vector<Nm> planes_through(const std::vector<Triangle>& facets) {
  Nm top = 0;
  std::map<Nm, std::int64_t> flat;  // height -> doubled area, roughly
  for (const Triangle& t : facets) {
    top = std::max({top, t.a.z, t.b.z, t.c.z});
    if (t.a.z == t.b.z && t.b.z == t.c.z) {
      const std::int64_t ux = t.b.x - t.a.x, uy = t.b.y - t.a.y, vx = t.c.x - t.a.x, vy = t.c.y - t.a.y;
      flat[t.a.z] += std::abs(ux * vy - uy * vx) >> 20;
    }
  }
  std::vector<std::pair<std::int64_t, Nm>> largest;
  for (const auto& [z, area] : flat) largest.emplace_back(area, z);
  std::sort(largest.rbegin(), largest.rend());
  largest.resize(std::min<std::size_t>(largest.size(), 2));
  std::set<Nm> planes{25'000, top - 1, top};
  for (const auto& [area, z] : largest) planes.insert({z - 1, z, z + 1});
  planes.insert({facets[facets.size() / 2].a.z, facets[facets.size() / 3].b.z});
  for (Nm i = 1; planes.size() < 14; ++i) planes.insert(static_cast<Nm>(std::int64_t{top} * (2 * i - 1) / 17));
  planes.erase(planes.begin(), planes.lower_bound(0));
  return {planes.begin(), planes.end()};
}

struct Checked {
  std::uint32_t parts = 0, layers = 0, too_large = 0;
  std::uint64_t pixels = 0;
};

/// Whether the documented outcome of a file is that it is refused.
bool is_to_be_refused(const std::string& name) {
  std::ifstream table(std::string(LAMINA_TEST_DIR) + "/corpus/outcomes.tsv");
  for (std::string line; std::getline(table, line);) {
    if (line.starts_with(name + "\t")) return line.substr(name.size() + 1).starts_with("refused\t");
  }
  return false;
}

void check_part(const fs::path& file, const std::string& name, Checked& checked) {
  SCOPED_TRACE(name);
  load::LoadOptions options;
  auto part = load::load(file.string(), options);
  if (!part) {
    EXPECT_TRUE(is_to_be_refused(name)) << part.error().message;
    return;
  }
  const std::int64_t side = std::max({part->bounds.width(), part->bounds.depth(), std::int64_t{1}});
  if (side > 1'000'000'000) {  // the reference tests every pixel
    ++checked.too_large;
    return;
  }
  const Point3 origin{1'234'567, 2'345'679, 0};
  const std::vector<Triangle> facets = facets_at(*part, origin);
  const std::vector<Nm> planes = planes_through(facets);
  ASSERT_GE(planes.size(), 12u);

  std::vector<Instance> instances = part->instances;
  for (Instance& instance : instances) {
    instance.offset.x += origin.x - part->bounds.lo.x;
    instance.offset.y += origin.y - part->bounds.lo.y;
    instance.offset.z += origin.z - part->bounds.lo.z;
  }
  for (const std::int64_t dpi : {std::int64_t{300}, std::int64_t{1200}}) {
    const PixelGrid grid{{dpi, part->bounds.width() + 3'000'000}, {dpi, part->bounds.depth() + 3'000'000}};
    std::vector<Mesh> meshes = part->meshes;
    auto rasterizer = raster::Rasterizer::build(meshes, instances, grid, FillRule::kNonzero, true, true);
    ASSERT_TRUE(rasterizer.ok());
    raster::LayerScratch scratch;
    Runs runs;
    for (const Nm plane : planes) {
      const Runs expected = reference_layer(facets, grid, plane, FillRule::kNonzero);
      for (const Engine engine : {Engine::kRays, Engine::kContours}) {
        const raster::LayerReport report = rasterizer->layer(engine, plane, scratch, runs);
        EXPECT_TRUE(std::ranges::equal(runs.row_offset, expected.row_offset) &&
                    std::ranges::equal(runs.change, expected.change))
            << (engine == Engine::kRays ? "rays" : "contours") << " differs at " << dpi << " dpi, z " << plane << " nm";
        EXPECT_EQ(report.open_rows, 0u) << "a row stays open at z " << plane;
        EXPECT_LE(report.crossings, rasterizer->crossings_bound(plane));
      }
      if (testing::Test::HasFailure()) return;
      ++checked.layers;
      checked.pixels += set_pixels(expected);
    }
  }
  ++checked.parts;
}

void check_folder(const fs::path& folder, std::uint32_t min_parts) {
  Checked checked;
  for (const fs::path& file : part_files(folder)) check_part(file, fs::relative(file, folder).string(), checked);
  EXPECT_GE(checked.parts, min_parts) << "too few parts in " << folder;
  EXPECT_LE(checked.too_large, 1u) << "parts of more than a metre are not compared";
  EXPECT_GT(checked.pixels, 0u);
  std::cout << "compared bit for bit with the contract: " << checked.parts << " parts, " << checked.layers
            << " layers, 2 engines, " << checked.pixels << " set pixels\n";
}

TEST(Models, EveryPartOfTheCorpusIsExactAt300And1200Dpi) { check_folder(fs::path(LAMINA_TEST_DIR) / "corpus", 5); }

TEST(Models, EveryPartOfTheModelFolderIsExactAt300And1200Dpi) {
  const char* folder = std::getenv("LAMINA_MODELS");
  if (folder == nullptr) {
    GTEST_SKIP() << "LAMINA_MODELS is not set: the large real parts were NOT compared with the contract";
  }
  check_folder(folder, 30);
}

}  // namespace
}  // namespace lamina::test
