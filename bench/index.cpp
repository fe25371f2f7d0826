// bench/index.cpp: cost of the rays' tree of a job's part, and the stated memory of a layer compared with the measured one.
#include <algorithm>

#include "bench/named_parts.h"
#include "stages/heights/heights.h"
#include "stages/raster/beams.h"

namespace lamina::bench {
namespace {

/// Builds the tree over clusters that are there. Counts its primitives and bytes, those of the runs below it included.
void tree(benchmark::State& state, const NamedJob& job, const std::string& path) {
  Part part;
  if (!load_on_bed(state, path, 0, 0, part)) return;
  std::vector<raster::ClusteredMesh> meshes;
  std::uint64_t primitives = 0;
  for (Mesh& mesh : part.meshes) {
    meshes.push_back(raster::make_clusters({&mesh, 1}).front());
    primitives += raster::HeightRuns(meshes.back().bounds).count();
  }
  std::vector<raster::PlacedMesh> placed;
  for (const Instance& instance : part.instances) placed.push_back({&meshes[instance.mesh], instance.offset});
  constexpr std::uint32_t kBandRows = 256;  // has no influence on the number of primitives
  std::uint64_t bytes = 0;
  for (auto _ : state) {
    const auto beams = raster::BeamIndex::build(placed, job.grid(), kBandRows);
    if (!beams) return state.SkipWithError(beams.error().message.c_str());
    bytes = beams->bytes();
  }
  state.counters["primitives"] = static_cast<double>(primitives);
  state.counters["bytes"] = static_cast<double>(bytes);
}

/// Layers of a job, every 16th: the bound of bytes, and what was written once: clusters, segments, crossings, changes, rows.
void bound(benchmark::State& state, const NamedJob& job, const std::string& path) {
  Part part;
  if (!load_on_bed(state, path, 0, 0, part)) return;
  auto rasterizer = raster::Rasterizer::build(part.meshes, part.instances, job.grid(), FillRule::kNonzero, false, true);
  if (!rasterizer) return state.SkipWithError(rasterizer.error().message.c_str());
  const heights::LayerTable table = heights::LayerTable::uniform(part.bounds.height(), job.layer);
  constexpr std::uint32_t kStep = 16;
  double claimed = 0, needed = 0, worst = 0;
  for (auto _ : state) {
    claimed = needed = worst = 0;
    for (std::uint32_t i = kStep / 2; i < table.size(); i += kStep) {
      raster::LayerScratch scratch;
      Runs runs;
      const raster::LayerReport report = rasterizer->layer(raster::Engine::kContours, table[i].plane(), scratch, runs);
      const auto said = static_cast<double>(rasterizer->layer_bytes_bound(table[i].plane()));
      const auto taken = static_cast<double>(scratch.visits.size() * sizeof(raster::ClusterVisit) +
                                             report.segments * raster::Segments::kBytes +
                                             4 * (report.crossings + runs.change.size() + 2 * runs.row_offset.size()));
      claimed += said, needed += taken;
      worst = std::max(worst, said / taken);
    }
  }
  state.counters["claimed"] = claimed;
  state.counters["needed"] = needed;
  state.counters["worst"] = worst;
}

[[maybe_unused]] const bool index_registered = [] {
  for (const NamedJob& job : named_jobs()) {
    const std::string path = job_path(job);
    if (path.empty()) continue;
    benchmark::RegisterBenchmark((std::string("tree/") + job.name).c_str(), tree, job, path)
        ->Unit(benchmark::kMillisecond)
        ->UseRealTime();
    benchmark::RegisterBenchmark((std::string("bound/") + job.name).c_str(), bound, job, path)
        ->Unit(benchmark::kMillisecond)
        ->Iterations(1);
  }
  return true;
}();

}  // namespace
}  // namespace lamina::bench
