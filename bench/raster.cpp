// bench/raster.cpp: layers of a part at 1200 dpi on one thread, by either engine; a few layers are first compared with
// the contract's slow reference of the tests, and the rest with the other engine.
#include "bench/named_parts.h"
#include "tests/raster/reference.h"

namespace lamina::bench {
namespace {

constexpr std::int64_t kRasterDpi = 1200;
constexpr int kPlanes = 32;

struct Setup {
  Part part;
  PixelGrid grid;
  std::vector<Nm> planes;  // nm, spread over the part's height

  bool load(benchmark::State& state, const std::string& path) {
    if (!load_on_bed(state, path, kNmPerMm, kNmPerMm, part)) return false;
    grid = snug_grid(part, kRasterDpi);
    for (int i = 0; i < kPlanes; ++i) planes.push_back(static_cast<Nm>(part.bounds.height() * (2 * i + 1) / (2 * kPlanes)));
    return true;
  }
  Result<raster::Rasterizer> build(bool rays, bool contours) {
    return raster::Rasterizer::build(part.meshes, part.instances, grid, FillRule::kNonzero, rays, contours);
  }
};

/// Empty if both engines give the reference's pixels in a few planes and each other's in all.
std::string wrong_with(const raster::Rasterizer& rasterizer, const Setup& setup, std::span<const Triangle> triangles) {
  raster::LayerScratch scratch;
  Runs rays, contours;
  for (std::size_t i = 0; i < setup.planes.size(); ++i) {
    const Nm plane = setup.planes[i];
    rasterizer.layer(raster::Engine::kRays, plane, scratch, rays);
    rasterizer.layer(raster::Engine::kContours, plane, scratch, contours);
    if (!same_runs(rays, contours)) return "engines differ at " + std::to_string(plane) + " nm";
    if (i % 16 != 8) continue;
    if (!same_runs(rays, test::reference_layer(triangles, setup.grid, plane, FillRule::kNonzero))) {
      return "engines differ from the reference at " + std::to_string(plane) + " nm";
    }
  }
  return {};
}

void layers(benchmark::State& state, raster::Engine engine, const std::string& path) {
  Setup setup;
  if (!setup.load(state, path)) return;
  const Buffer<Triangle> triangles = flattened(setup.part);
  auto rasterizer = setup.build(true, true);
  if (!rasterizer) return state.SkipWithError(rasterizer.error().message.c_str());
  const std::string wrong = wrong_with(*rasterizer, setup, triangles);
  if (!wrong.empty()) return state.SkipWithError(wrong.c_str());

  raster::LayerScratch scratch;
  Runs runs;
  std::uint64_t crossings = 0;
  std::size_t next = 0;
  for (auto _ : state) {
    crossings += rasterizer->layer(engine, setup.planes[next], scratch, runs).crossings;
    next = (next + 1) % setup.planes.size();
  }
  const double pixels = double{1} * setup.grid.columns() * setup.grid.rows();
  state.counters["px/s"] = benchmark::Counter(pixels, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["crossings/s"] = benchmark::Counter(static_cast<double>(crossings), benchmark::Counter::kIsRate);
}

void index(benchmark::State& state, raster::Engine engine, const std::string& path) {
  Setup setup;
  if (!setup.load(state, path)) return;
  const auto meshes = setup.part.meshes;
  for (auto _ : state) {
    state.PauseTiming();
    setup.part.meshes = meshes;
    state.ResumeTiming();
    auto rasterizer = setup.build(engine == raster::Engine::kRays, engine == raster::Engine::kContours);
    benchmark::DoNotOptimize(rasterizer);
  }
}

[[maybe_unused]] const bool raster_registered = [] {
  for (const NamedPart& part : named_parts()) {
    const std::string path = model_path(part);
    if (path.empty()) continue;
    const std::string name = part.name;
    for (auto [engine, word] : {std::pair{raster::Engine::kRays, "rays"}, std::pair{raster::Engine::kContours, "contours"}}) {
      benchmark::RegisterBenchmark(("index/" + name + "/" + word).c_str(), index, engine, path)
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime();
      benchmark::RegisterBenchmark(("raster/" + name + "/" + word).c_str(), layers, engine, path)
          ->Unit(benchmark::kMicrosecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace lamina::bench
