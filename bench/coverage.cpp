// bench/coverage.cpp: layers of a part at 1200 dpi on one thread as a bitmap and as shares of voxels with 4 levels, in one run.
// Both must report the same for what is far from any surface.
#include <chrono>

#include "bench/named_parts.h"
#include "stages/coverage/coverage.h"
#include "stages/heights/heights.h"

namespace lamina::bench {
namespace {

constexpr std::uint32_t kCoverageLayers = 24;

struct CoveredPart {
  Part part;
  PixelGrid grid;
  std::vector<Layer> layers;

  void choose_layers(Nm thickness) {
    const heights::LayerTable table = heights::LayerTable::uniform(part.bounds.height(), thickness);
    for (std::uint32_t i = 0; i < kCoverageLayers; ++i) layers.push_back(table[table.size() * i / kCoverageLayers]);
  }
};

/// Whether voxels that are full are pixels that are set, and empty ones not, but for one in a thousand: thin walls.
bool agree(const RunsView& pixels, const LevelsView& levels, std::uint8_t top) {
  Runs full, some;
  threshold_levels(levels, top, full);
  threshold_levels(levels, 1, some);
  const auto set = static_cast<double>(set_pixels(pixels));
  return static_cast<double>(set_pixels(full)) <= 1.001 * set && static_cast<double>(set_pixels(some)) >= 0.999 * set;
}

void both(benchmark::State& state, const std::string& path, const NamedJob* job) {
  CoveredPart covered;
  if (!load_on_bed(state, path, job != nullptr ? 0 : kNmPerMm, job != nullptr ? 0 : kNmPerMm, covered.part)) return;
  covered.grid = job != nullptr ? job->grid() : snug_grid(covered.part, 1200);
  covered.choose_layers(job != nullptr ? job->layer : 100'000);
  std::vector<Mesh> meshes = covered.part.meshes;
  const auto started = std::chrono::steady_clock::now();
  auto coverage = coverage::Coverage::build(meshes, covered.part.instances, covered.grid, FillRule::kNonzero, 4);
  const std::chrono::duration<double, std::milli> built = std::chrono::steady_clock::now() - started;
  auto rasterizer =
      raster::Rasterizer::build(covered.part.meshes, covered.part.instances, covered.grid, FillRule::kNonzero, true, false);
  if (!coverage || !rasterizer) return state.SkipWithError("the part could not be indexed");
  raster::LayerScratch of_pixels;
  coverage::CoverageScratch of_voxels;
  Runs runs;
  Levels levels;
  std::chrono::duration<double, std::milli> pixels{}, voxels{};
  std::uint64_t held = 0, exact = 0, count = 0;
  for (auto _ : state) {
    for (const Layer& layer : covered.layers) {
      const auto begin = std::chrono::steady_clock::now();
      rasterizer->layer(raster::Engine::kRays, layer.plane(), of_pixels, runs);
      const auto middle = std::chrono::steady_clock::now();
      const auto report = coverage->layer(layer, of_voxels, levels);
      voxels += std::chrono::steady_clock::now() - middle;
      pixels += middle - begin;
      exact += report.exact_voxels;
      ++count;
      if (!agree(runs, levels, 3)) return state.SkipWithError("voxels and pixels differ");
    }
  }
  of_voxels.counts_held = true;
  for (const Layer& layer : covered.layers) held += coverage->layer(layer, of_voxels, levels).held_voxels;
  const auto layers = static_cast<double>(count);
  state.counters["bitmap_ms"] = pixels.count() / layers;
  state.counters["coverage_ms"] = voxels.count() / layers;
  state.counters["times"] = voxels.count() / pixels.count();
  state.counters["build_ms"] = built.count();
  state.counters["held"] = static_cast<double>(held) / kCoverageLayers;
  state.counters["exact"] = static_cast<double>(exact) / layers;
}

[[maybe_unused]] const bool coverage_registered = [] {
  for (const NamedPart& part : named_parts()) {
    const std::string path = model_path(part);
    if (path.empty()) continue;
    benchmark::RegisterBenchmark((std::string("coverage/") + part.name).c_str(), both, path, nullptr)
        ->Unit(benchmark::kMillisecond);
  }
  for (const NamedJob& job : named_jobs()) {
    const std::string path = job_path(job);
    if (path.empty()) continue;
    benchmark::RegisterBenchmark((std::string("coverage/job/") + job.name).c_str(), both, path, &job)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace lamina::bench
