// bench/limits.cpp: the least that a job of scripts/bench could do: touch each crossing of a row with the surface once.
// The parts are those of bench/make_parts.py (bench/named_parts.h).
#include "bench/named_parts.h"
#include "stages/heights/heights.h"

namespace lamina::bench {
namespace {

/// Two passes over all changes of colour of all layers, as memory holds them: one writes them, one reads them.
void touch_crossings(benchmark::State& state, const NamedJob& job, const std::string& path) {
  Part part;
  if (!load_on_bed(state, path, 0, 0, part)) return;
  auto rasterizer = raster::Rasterizer::build(part.meshes, part.instances, job.grid(), FillRule::kNonzero, false, true);
  if (!rasterizer) return state.SkipWithError(rasterizer.error().message.c_str());
  raster::LayerScratch scratch;
  Runs runs;
  Buffer<std::uint32_t> all;
  const heights::LayerTable table = heights::LayerTable::uniform(part.bounds.height(), job.layer);
  for (std::uint32_t i = 0; i < table.size(); ++i) {
    rasterizer->layer(raster::Engine::kContours, table[i].plane(), scratch, runs);
    all.insert(all.end(), runs.change.begin(), runs.change.end());
  }
  Buffer<std::uint32_t> copy(all.size());
  for (auto _ : state) {
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      copy[i] = all[i];
      sum ^= all[i];
    }
    benchmark::DoNotOptimize(sum);
    benchmark::ClobberMemory();
  }
  state.counters["crossings"] = static_cast<double>(all.size());
  state.counters["layers"] = table.size();
}

[[maybe_unused]] const bool limits_registered = [] {
  for (const NamedJob& job : named_jobs()) {
    const std::string path = job_path(job);
    if (path.empty()) continue;
    benchmark::RegisterBenchmark((std::string("limits/") + job.name).c_str(), touch_crossings, job, path)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace lamina::bench
