// bench/limits.cpp: the least that a job of scripts/bench could do: touch each crossing of a row with the surface once.
// The parts are those of bench/make_parts.py, in the folder that LAMINA_BENCH_PARTS names.
#include <cstdlib>
#include <filesystem>
#include <numeric>

#include "bench/named_parts.h"
#include "stages/heights/table.h"

namespace lamina::bench {
namespace {

struct Job {
  const char* name;
  const char* file;
  std::int64_t bed;  // nm
  Nm layer;          // nm
};
constexpr Job kJobs[] = {
    {"terrain", "terrain.stl", 100'000'000, 100'000},     {"benchy", "benchy15.stl", 100'000'000, 100'000},
    {"crowns-20", "crowns96.stl", 400'000'000, 480'000},  {"crowns-96", "crowns96.stl", 400'000'000, 100'000},
    {"benchies", "benchies72.stl", 400'000'000, 100'000}, {"knot800k", "knot800k.stl", 100'000'000, 50'000},
    {"scan680k", "scan680k.stl", 100'000'000, 100'000},
};

/// Two passes over all changes of colour of all layers, as memory holds them: one writes them, one reads them.
void touch_crossings(benchmark::State& state, const Job& job, const std::string& path) {
  Part part;
  if (!load_on_bed(state, path, 0, 0, part)) return;
  const PixelGrid grid{{1200, job.bed}, {1200, job.bed}};
  auto rasterizer = raster::Rasterizer::build(part.meshes, part.instances, grid, FillRule::kNonzero, false, true);
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
  const char* folder = std::getenv("LAMINA_BENCH_PARTS");
  for (const Job& job : kJobs) {
    const std::string path = folder == nullptr ? std::string() : std::string(folder) + "/" + job.file;
    if (path.empty() || !std::filesystem::exists(path)) continue;
    benchmark::RegisterBenchmark((std::string("limits/") + job.name).c_str(), touch_crossings, job, path)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace lamina::bench
