// Layers of parts on a machine, and their programs, for tests of single dialects.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "pipeline/machine/profiles.h"
#include "stages/load/load.h"
#include "stages/program/compile.h"
#include "stages/program/dialect.h"
#include "stages/raster/raster.h"
#include "stages/replay/machine.h"

namespace lamina::printed_parts {

inline const Layer kLayer{7, 700'000, 100'000, LayerReason::kUniform};

/// That of kLayer, of nine.
inline LayerCycle cycle_of_layer() {
  LayerCycle cycle;
  cycle.layer = kLayer.index;
  cycle.layers = 9;
  cycle.bottom_nm = kLayer.bottom;
  cycle.thickness_nm = kLayer.thickness;
  return cycle;
}

struct Program {
  std::string text;
  ProgramCount count;
};

inline Program program_of(const pipeline::ResolvedMachine& resolved, const RunsView& image) {
  const auto writer = program::find_dialect(resolved.machine.dialect)->make_writer(resolved.machine, resolved.grid);
  const LayerCycle cycle = cycle_of_layer();
  program::ProgramBytes bytes;
  writer->begin_layer(cycle, bytes);
  writer->maintenance_of_layer(cycle, bytes);
  program::CompileScratch scratch;
  const auto count = program::compile(
      resolved.grid, image, scratch,
      [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
        writer->maintenance_before(sweep, vectors, bytes);
        writer->sweep(sweep, vectors, bytes);
        return {};
      },
      kLayer.index);
  EXPECT_TRUE(count.ok());
  writer->maintenance_after(bytes);
  writer->end_layer(cycle, bytes);
  return {std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()), *count};
}

inline Result<replay::Count> verified(const pipeline::ResolvedMachine& resolved, const RunsView& image,
                                      const Program& program) {
  const auto machine =
      replay::VirtualMachine::build(resolved.machine, resolved.grid.image.columns(), resolved.grid.image.rows());
  if (!machine) return machine.error();
  return machine->replay(program.text, kLayer, image, program.count.moved, program.count.lost);
}

/// Twelve layers of a part of the corpus, `side_mm` long across its larger side, with its corner at `at_mm` of the bed.
inline std::vector<Runs> twelve_layers(const std::string& name, double side_mm, double at_mm, const PixelGrid& grid) {
  load::LoadOptions options;
  const auto part = load::load(std::string(LAMINA_TEST_DIR) + "/corpus/" + name, options);
  EXPECT_TRUE(part.ok()) << name << (part.ok() ? "" : part.error().message);
  if (!part.ok()) return {};
  const double factor = side_mm * 1e6 / static_cast<double>(std::max(part->bounds.width(), part->bounds.depth()));
  const Point3 from = part->bounds.lo;
  const auto at = [&](Nm v, Nm low, double to_mm) {
    return static_cast<Nm>(std::llround(static_cast<double>(v - low) * factor + to_mm * 1e6));
  };
  std::vector<Mesh> meshes = part->meshes;
  std::vector<Instance> instances;
  for (std::uint32_t i = 0; i < part->instances.size(); ++i) {
    const Instance& instance = part->instances[i];
    Mesh mesh = part->meshes[instance.mesh];
    mesh.bounds = {};
    for (Triangle& t : mesh.triangles) {
      const auto placed = [&](const Point3& p) {
        return Point3{at(p.x + instance.offset.x, from.x, at_mm), at(p.y + instance.offset.y, from.y, at_mm),
                      at(p.z + instance.offset.z, from.z, 0)};
      };
      t = {placed(t.a), placed(t.b), placed(t.c)};
      for (const Point3& p : {t.a, t.b, t.c}) mesh.bounds.add(p);
    }
    instances.push_back({static_cast<std::uint32_t>(meshes.size()), {}});
    meshes.push_back(std::move(mesh));
  }
  const auto rasterizer = raster::Rasterizer::build(meshes, instances, grid, FillRule::kNonzero, false, true);
  EXPECT_TRUE(rasterizer.ok());
  std::vector<Runs> layers(12);
  raster::LayerScratch scratch;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const double z = (static_cast<double>(i) + 0.5) / 12 * static_cast<double>(part->bounds.height()) * factor;
    rasterizer->layer(raster::Engine::kContours, static_cast<Nm>(z), scratch, layers[i]);
  }
  return layers;
}

/// The parts of the corpus that dialects print, each another one of gaps, holes, islands.
struct CorpusPart {
  const char* name;
  double side_mm, at_mm;
};
inline constexpr CorpusPart kFiveParts[] = {{"parameter_quality_nut.stl", 3, 1},  // one band
                                            {"nist_am_test_artifact_v3b.stl", 70, 10},
                                            {"dental_crown.stl", 40, 0},
                                            {"quad_knot.obj", 60, 5},
                                            {"nist_part_feature_open.stl", 70, 30}};

/// Of a shipped machine.
inline pipeline::ResolvedMachine shipped(const std::string& name, auto&& change) {
  Machine machine = *pipeline::find_machine(name);
  change(machine);
  const auto resolved = pipeline::resolve_profile(machine);
  EXPECT_TRUE(resolved.ok()) << (resolved.ok() ? "" : resolved.error().message);
  return *resolved;
}

inline bool is_set(const RunsView& image, std::int64_t column, std::int64_t row) {
  if (row < 0 || column < 0 || row >= image.rows() || column >= image.columns) return false;
  const auto line = image.row(static_cast<std::uint32_t>(row));
  return (std::upper_bound(line.begin(), line.end(), static_cast<std::uint32_t>(column)) - line.begin()) % 2 == 1;
}

}  // namespace lamina::printed_parts
