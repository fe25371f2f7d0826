// tests/slice/test_models.cpp: contours of real parts against the bitmaps, the mesh's volume and themselves.
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "stages/load/load.h"
#include "stages/raster/raster.h"
#include "stages/slice/slice.h"
#include "tests/load/files.h"
#include "tests/slice/contour_laws.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

/// A contour lies within 0.71 nm of the true cut and a union rounds its corners once more: a pixel's centre nearer than
/// this to a contour may be classified differently.
constexpr double kNearNm = 1.5;

struct Checked {
  std::uint32_t parts = 0, layers = 0, merged = 0;
  std::uint64_t pixels = 0, differing = 0;
};

void compare_with_bitmap(const ContoursView& contours, const Runs& bitmap, const PixelGrid& grid, Checked& checked) {
  const Runs own = rasterized(contours, grid);
  const double pixel = static_cast<double>(grid.x.centre(1000) - grid.x.centre(0)) / 1000;
  checked.pixels += set_pixels(bitmap);
  for (std::uint32_t r = 0; r < bitmap.view().rows(); ++r) {
    const auto a = bitmap.view().row(r), b = own.view().row(r);
    if (std::ranges::equal(a, b)) continue;
    // Columns at which exactly one of the two changes colour bound the pixels that differ.
    std::vector<std::uint32_t> change;
    std::ranges::set_symmetric_difference(a, b, std::back_inserter(change));
    for (std::size_t i = 0; i + 1 < change.size(); i += 2) {
      for (std::uint32_t column = change[i]; column < change[i + 1]; ++column) {
        ++checked.differing;
        const auto y = static_cast<double>(grid.y.centre(grid.rows() - 1 - r));
        ASSERT_LE(distance_to(contours, static_cast<double>(grid.x.centre(column)), y), kNearNm)
            << "image row " << r << ", column " << column;
      }
    }
  }
  const double area = static_cast<double>(doubled_area(contours)) / 2;
  EXPECT_LE(std::abs(area - static_cast<double>(set_pixels(bitmap)) * pixel * pixel),
            perimeter(contours) * pixel + pixel * pixel);
}

/// Planes at the middle of layers, all of them inside the part.
std::vector<Nm> planes_of(const Part& part, std::int64_t layers) {
  std::vector<Nm> planes;
  for (std::int64_t i = 0; i < layers; ++i) {
    const auto z = static_cast<Nm>(part.bounds.lo.z + part.bounds.height() * (2 * i + 1) / (2 * layers));
    if (planes.empty() || z > planes.back()) planes.push_back(z);
  }
  return planes;
}

double volume_of(const Part& part) {
  double sum = 0;
  for (const Instance& instance : part.instances) {
    for (const Triangle& t : part.meshes[instance.mesh].triangles) {
      const double z0 = part.bounds.lo.z - static_cast<double>(instance.offset.z);
      const double nz = (static_cast<double>(t.b.x) - t.a.x) * (static_cast<double>(t.c.y) - t.a.y) -
                        (static_cast<double>(t.b.y) - t.a.y) * (static_cast<double>(t.c.x) - t.a.x);
      sum += nz / 2 * ((static_cast<double>(t.a.z) + t.b.z + t.c.z) / 3 - z0);
    }
  }
  return sum;
}

void check_part(const fs::path& file, std::int64_t layers, Checked& checked) {
  load::LoadOptions load_options;
  auto part = load::load(file.string(), load_options);
  if (!part) return;  // refused files are tests/load's business
  if (std::max(part->bounds.width(), part->bounds.depth()) > 1'000'000'000 || part->bounds.height() < 2 * layers) return;
  SCOPED_TRACE(file.filename().string());
  // Onto the bed, 1 mm from its corner.
  std::vector<Instance> instances = part->instances;
  for (Instance& instance : instances) {
    instance.offset.x += 1'000'000 - part->bounds.lo.x;
    instance.offset.y += 1'000'000 - part->bounds.lo.y;
  }
  const std::vector<std::uint32_t> body(instances.size(), 0);
  const std::vector<Nm> planes = planes_of(*part, layers);
  const auto slicer = slice::Slicer::build(part->meshes, instances, body, planes, {});
  ASSERT_TRUE(slicer.ok()) << slicer.error().message;

  std::vector<slice::LayerContours> sliced(planes.size());
  std::vector<slice::SectionReport> reports(planes.size());
  tbb::parallel_for(std::size_t{0}, planes.size(), [&](std::size_t p) {
    slice::SectionScratch scratch;
    auto report = slicer->layer(static_cast<std::uint32_t>(p), scratch, sliced[p]);
    if (report) reports[p] = *report;
  });
  const std::int64_t dpi = std::max(part->bounds.width(), part->bounds.depth()) > 300'000'000 ? 100 : 300;
  const PixelGrid grid{{dpi, part->bounds.width() + 2'000'000}, {dpi, part->bounds.depth() + 2'000'000}};
  std::vector<Mesh> meshes = part->meshes;
  auto rasterizer = raster::Rasterizer::build(meshes, instances, grid, FillRule::kNonzero, false, true);
  ASSERT_TRUE(rasterizer.ok());
  raster::LayerScratch scratch;
  slice::SectionScratch other;
  slice::LayerContours again;
  Runs bitmap;
  for (std::size_t p = 0; p < planes.size(); ++p) {
    const Contours& contours = sliced[p].contours;
    EXPECT_EQ(reports[p].gaps.open, 0u) << "open at z " << planes[p];
    if (contours.point.size() < 20'000) expect_clean(contours, "z " + std::to_string(planes[p]));
    rasterizer->layer(raster::Engine::kContours, planes[p], scratch, bitmap);
    compare_with_bitmap(contours, bitmap, grid, checked);
    if (testing::Test::HasFailure()) return;
    checked.merged += reports[p].merged;
    ++checked.layers;
  }
  // One thread, backwards, with buffers that are full of another layer.
  for (std::size_t p = planes.size(); p-- > 0;) {
    ASSERT_TRUE(slicer->layer(static_cast<std::uint32_t>(p), other, again).ok());
    ASSERT_TRUE(again.contours.point == sliced[p].contours.point && again.contours.offset == sliced[p].contours.offset);
  }
  ++checked.parts;
}

void check_folder(const fs::path& folder, std::int64_t layers, std::uint32_t min_parts) {
  Checked checked;
  for (const fs::path& file : part_files(folder)) check_part(file, layers, checked);
  EXPECT_GE(checked.parts, min_parts);
  std::cout << checked.parts << " parts, " << checked.layers << " layers (" << checked.merged << " merged): of "
            << checked.pixels << " set pixels " << checked.differing << " differ, all within " << kNearNm
            << " nm of a contour\n";
}

TEST(SliceModels, ContoursOfTheCorpusAreCleanAndRasterizeToTheBitmaps) {
  check_folder(fs::path(LAMINA_TEST_DIR) / "corpus", 12, 20);
}

TEST(SliceModels, ContoursOfTheModelFolderAreCleanAndRasterizeToTheBitmaps) {
  const char* folder = std::getenv("LAMINA_MODELS");
  if (folder == nullptr) GTEST_SKIP() << "LAMINA_MODELS is not set: contours of the large real parts were NOT checked";
  check_folder(folder, 5, 30);
}

/// Area times thickness misses the volume by what lies between the surface and the steps: at most thickness times the
/// flat outline of all facets (the part's shadow, counted for every facet), a quarter of it for planes in the middle.
TEST(SliceModels, VolumeIsAreaTimesThicknessAtThreeThicknesses) {
  for (const char* name : {"nist_am_test_artifact_v3b.stl", "dental_crown.stl", "quad_knot.obj", "cube_gears_17_items.3mf"}) {
    load::LoadOptions load_options;
    auto part = load::load((fs::path(LAMINA_TEST_DIR) / "corpus" / name).string(), load_options);
    ASSERT_TRUE(part.ok()) << part.error().message;
    const double volume = volume_of(*part) * 1e-18;
    double shadow = 0;
    for (const Instance& instance : part->instances) {
      for (const Triangle& t : part->meshes[instance.mesh].triangles) {
        shadow += std::abs((static_cast<double>(t.b.x) - t.a.x) * (static_cast<double>(t.c.y) - t.a.y) -
                           (static_cast<double>(t.b.y) - t.a.y) * (static_cast<double>(t.c.x) - t.a.x)) /
                  2;
      }
    }
    for (const std::int64_t layers : {40, 160, 640}) {
      const std::vector<Nm> planes = planes_of(*part, layers);
      const std::vector<std::uint32_t> body(part->instances.size(), 0);
      slice::SliceOptions options;
      options.fill_rule = FillRule::kPositive;
      const auto slicer = slice::Slicer::build(part->meshes, part->instances, body, planes, options);
      ASSERT_TRUE(slicer.ok());
      slice::SectionScratch scratch;
      slice::LayerContours contours;
      const double thickness = static_cast<double>(part->bounds.height()) / static_cast<double>(layers);
      double sum = 0;
      for (std::uint32_t p = 0; p < planes.size(); ++p) {
        ASSERT_TRUE(slicer->layer(p, scratch, contours).ok());
        sum += static_cast<double>(doubled_area(contours.contours)) / 2 * thickness;
      }
      EXPECT_LE(std::abs(sum * 1e-18 - volume), shadow * thickness / 2 * 1e-18) << name << ", " << layers << " layers";
    }
  }
}

}  // namespace
}  // namespace lamina::test
