// bench/heights.cpp: the pass over the facets and every way to decide layers; a table is checked before it is timed.
#include <memory>
#include <vector>

#include "bench/named_parts.h"
#include "stages/heights/evaluate.h"
#include "stages/heights/heights.h"

namespace lamina::bench {
namespace {

heights::Options options_of(heights::Mode mode, Nm minimum, Nm maximum) {
  heights::Options options;
  options.mode = mode;
  for (Nm value = minimum; value <= maximum; value += 1000) options.set.values.push_back(value);
  return options;
}

heights::SurfaceIndex index_of(const Part& part) {
  const std::vector<std::uint32_t> parts(part.instances.size(), 0);
  return heights::index_surface(part.meshes, part.instances, parts, 1, {});
}

// Empty if the table keeps what its way promises.
std::string wrong_with(const heights::Plan& plan, const heights::SurfaceIndex& index, const heights::Options& options) {
  const heights::Evaluation found = heights::evaluate(index, heights::boundaries_of(plan.table), options);
  if (options.mode == heights::Mode::kAngle) return {};
  for (std::uint32_t i = 0; i < plan.table.size(); ++i) {
    if (found.layers[i].cusp > options.cusp && plan.table[i].thickness > options.set.minimum()) return "a step is too high";
  }
  return options.mode == heights::Mode::kOptimal && found.flats_missed > 0 ? "a flat is missed" : "";
}

void index_part(benchmark::State& state, const std::string& path) {
  Part part;
  if (!load_on_bed(state, path, 0, 0, part)) return;
  for (auto _ : state) {
    auto index = index_of(part);
    benchmark::DoNotOptimize(index);
  }
}

void plan_part(benchmark::State& state, const std::string& path, heights::Mode mode) {
  Part part;
  if (!load_on_bed(state, path, 0, 0, part)) return;
  const heights::SurfaceIndex index = index_of(part);
  const heights::Options options = options_of(mode, 50'000, 300'000);
  const auto checked = heights::plan_heights(index, options);
  const std::string wrong = checked ? wrong_with(*checked, index, options) : checked.error().message;
  if (!wrong.empty()) return state.SkipWithError(wrong.c_str());
  for (auto _ : state) {
    auto plan = heights::plan_heights(index, options);
    benchmark::DoNotOptimize(plan);
  }
  state.counters["layers"] = checked->table.size();
}

// A zigzag wall of slopes, `height_mm` tall: the time grows with its height, not with its square.
void plan_tall(benchmark::State& state) {
  const auto height = static_cast<Nm>(state.range(0) * kNmPerMm);
  Part part;
  Mesh& mesh = part.meshes.emplace_back();
  constexpr Nm kRise = 700'000;
  for (Nm z = 0; z + kRise <= height; z += kRise) {
    const Nm out = (z / kRise) % 3 * 400'000, next = (z / kRise + 1) % 3 * 400'000;
    mesh.triangles.push_back({{out, 0, z}, {out, 10'000'000, z}, {next, 0, z + kRise}});
  }
  for (const Triangle& t : mesh.triangles) {
    for (const Point3& p : {t.a, t.b, t.c}) mesh.bounds.add(p);
  }
  part.instances.push_back({0, {0, 0, 0}});
  const heights::SurfaceIndex index = index_of(part);
  const heights::Options options = options_of(heights::Mode::kOptimal, 20'000, 300'000);
  const auto checked = heights::plan_heights(index, options);
  const std::string wrong = checked ? wrong_with(*checked, index, options) : checked.error().message;
  if (!wrong.empty()) return state.SkipWithError(wrong.c_str());
  for (auto _ : state) {
    auto plan = heights::plan_heights(index, options);
    benchmark::DoNotOptimize(plan);
  }
  state.SetComplexityN(state.range(0));
}
BENCHMARK(plan_tall)
    ->Name("heights/optimal/tall")
    ->RangeMultiplier(2)
    ->Range(125, 1000)
    ->Unit(benchmark::kMillisecond)
    ->Complexity();

[[maybe_unused]] const bool heights_registered = [] {
  using heights::Mode;
  for (const NamedPart& part : named_parts()) {
    const std::string path = model_path(part);
    if (path.empty()) continue;
    const auto add = [&](const std::string& what, auto run) {
      benchmark::RegisterBenchmark(("heights/" + what + "/" + part.name).c_str(), run)->Unit(benchmark::kMillisecond);
    };
    add("index", [path](benchmark::State& state) { index_part(state, path); });
    for (const auto& [name, mode] : {std::pair{"angle", Mode::kAngle},
                                     {"cusp", Mode::kCusp},
                                     {"stepwise", Mode::kStepwise},
                                     {"optimal", Mode::kOptimal}}) {
      add(name, [path, mode = mode](benchmark::State& state) { plan_part(state, path, mode); });
    }
  }
  return true;
}();

}  // namespace
}  // namespace lamina::bench
