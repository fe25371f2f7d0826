#include "tests/infill/outlines.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include "stages/load/load.h"
#include "stages/slice/slice.h"

namespace lamina::test {

Contours contours_of(std::initializer_list<std::vector<std::array<double, 2>>> all) {
  Contours out;
  for (const auto& one : all) {
    for (const auto& [x, y] : one)
      out.point.push_back({static_cast<Nm>(std::llround(x * kMm)), static_cast<Nm>(std::llround(y * kMm))});
    out.close();
  }
  return out;
}

namespace {

/// A layer of a real part, at a share of its height.
Contours layer_of(const char* file, double share) {
  auto part = load::load((std::filesystem::path(LAMINA_TEST_DIR) / "corpus" / file).string(), {});
  EXPECT_TRUE(part.ok());
  std::vector<Instance> instances = part->instances;
  for (Instance& instance : instances) {
    instance.offset.x += 100 * kMm - part->bounds.lo.x;
    instance.offset.y += 50 * kMm - part->bounds.lo.y;
  }
  const std::vector<std::uint32_t> body(instances.size(), 0);
  const std::vector<Nm> planes{static_cast<Nm>(part->bounds.lo.z + share * static_cast<double>(part->bounds.height()))};
  const auto slicer = slice::Slicer::build(part->meshes, instances, body, planes, {});
  slice::SectionScratch scratch;
  slice::LayerContours layer;
  EXPECT_TRUE(slicer->layer(0, scratch, layer).ok());
  EXPECT_GT(layer.contours.size(), 0u) << file;
  return layer.contours;
}

}  // namespace

const std::vector<Outline>& outlines() {
  static const std::vector<Outline> all = [] {
    std::vector<Outline> list;
    list.push_back({"square", contours_of({{{0, 0}, {20, 0}, {20, 20}, {0, 20}}})});
    list.push_back({"needle", contours_of({{{0, 0}, {30, -0.3}, {60, 0}, {30, 0.3}}})});
    list.push_back({"sliver", contours_of({{{0, 0}, {25, 24.5}, {25, 25}}})});
    list.push_back({"touching holes", contours_of({{{0, 0}, {20, 0}, {20, 20}, {0, 20}},
                                                   {{4, 4}, {4, 10}, {10, 10}, {10, 4}},
                                                   {{10, 10}, {10, 16}, {16, 16}, {16, 10}}})});
    list.push_back({"islands in holes", contours_of({{{0, 0}, {24, 0}, {24, 24}, {0, 24}},
                                                     {{3, 3}, {3, 21}, {21, 21}, {21, 3}},
                                                     {{6, 6}, {18, 6}, {18, 18}, {6, 18}},
                                                     {{9, 9}, {9, 15}, {15, 15}, {15, 9}}})});
    Contours comb;
    comb.point.push_back({0, 0});
    comb.point.push_back({20 * kMm, 0});
    for (int tooth = 9; tooth >= 0; --tooth) {
      for (const Point2 p : {Point2{tooth * 2 + 2, 12}, {tooth * 2 + 1, 12}, {tooth * 2 + 1, 3}, {tooth * 2, 3}}) {
        if (p.y != 3 || p.x != 0 || tooth != 0) comb.point.push_back({p.x * kMm, p.y * kMm});
      }
    }
    comb.point.push_back({0, 3 * kMm});
    comb.close();
    list.push_back({"comb", comb});
    list.push_back({"nist", layer_of("nist_am_test_artifact_v3b.stl", 0.6)});
    list.push_back({"crown", layer_of("dental_crown.stl", 0.3)});
    list.push_back({"knot", layer_of("quad_knot.obj", 0.45)});
    list.push_back({"nut", layer_of("parameter_quality_nut.stl", 0.5)});
    return list;
  }();
  return all;
}

const Contours& outline(const std::string& name) {
  for (const Outline& one : outlines()) {
    if (one.name == name) return one.contours;
  }
  ADD_FAILURE() << "no outline is called " << name;
  return outlines().front().contours;
}

infill::FillContext context_of(const ContoursView& contours, std::uint32_t index) {
  infill::FillContext context;
  context.layer = {index, static_cast<Nm>(index) * 200'000, 200'000};
  for (const Point2 p : contours.point) context.part.add(Point3{p.x, p.y, 0});
  context.part.add(Point3{contours.point.front().x, contours.point.front().y, 20 * kMm});
  return context;
}

Status fill(const ContoursView& contours, const infill::FillContext& context, const infill::FillParameters& parameters,
            Toolpaths& out) {
  auto outlines = infill::outlines_of(contours, context, parameters);
  if (!outlines) return outlines.error();
  return infill::append_fill(std::move(*outlines), context, parameters, out);
}

Toolpaths filled(const ContoursView& contours, const infill::FillContext& context, const infill::FillParameters& parameters) {
  Toolpaths paths;
  const Status status = fill(contours, context, parameters, paths);
  EXPECT_TRUE(status.ok()) << (status ? "" : status.error().message);
  return paths;
}

Sums sums_of(const Toolpaths& paths) {
  Sums sums;
  for (std::uint32_t p = 0; p < paths.size(); ++p) {
    for (std::uint32_t i = paths.offset[p]; i + 1 < paths.offset[p + 1]; ++i) {
      const Point2 a = paths.point[i], b = paths.point[i + 1];
      const double length = std::hypot(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
      if (paths.kind[i] == PathKind::kRaster) sums.raster += length;
      if (paths.kind[i] == PathKind::kLink) sums.link += length;
      if (paths.kind[i] == PathKind::kContour) sums.closed += length;
    }
  }
  return sums;
}

std::vector<Nm> positions_of(const infill::FillParameters& parameters, std::uint32_t layer) {
  const Contours& square = outline("square");
  infill::FillParameters own = parameters;
  own.angle_base = own.angle_step = 0;
  const Toolpaths paths = filled(square, context_of(square, layer), own);
  std::set<Nm> positions;
  for (std::size_t i = 0; i < paths.point.size(); ++i) {
    if (paths.line[i] != kNoLine) positions.insert(paths.point[i].y);
  }
  return {positions.begin(), positions.end()};
}

std::vector<Nm> distances_of(const std::vector<Nm>& positions) {
  std::vector<Nm> distances;
  for (std::size_t i = 1; i < positions.size(); ++i) distances.push_back(positions[i] - positions[i - 1]);
  return distances;
}

}  // namespace lamina::test
