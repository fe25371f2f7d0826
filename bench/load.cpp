// bench/load.cpp: part files into nanometres; checked against a reader that takes one number after another.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <vector>

#include "bench/named_parts.h"
#include "stages/load/load.h"
#include "stages/load/repair/diagnose.h"

namespace lamina::bench {
namespace {

/// Triangles of an uncompressed binary STL in file order, read and rounded one by one.
std::vector<Triangle> slow_stl(const std::string& path) {
  std::vector<Triangle> triangles;
  std::FILE* file = std::fopen(path.c_str(), "rb");
  if (file == nullptr) return triangles;
  std::fseek(file, 84, SEEK_SET);
  unsigned char record[50];
  while (std::fread(record, sizeof record, 1, file) == 1) {
    float number[12];
    std::memcpy(number, record, sizeof number);
    const auto snapped = [&number](int at) {
      return Point3{static_cast<Nm>(std::llround(double{number[at]} * 1e6)),
                    static_cast<Nm>(std::llround(double{number[at + 1]} * 1e6)),
                    static_cast<Nm>(std::llround(double{number[at + 2]} * 1e6))};
    };
    triangles.push_back({snapped(3), snapped(6), snapped(9)});
  }
  std::fclose(file);
  return triangles;
}

/// Empty if the part is what the file says, otherwise what is wrong.
std::string wrong_with(const Part& part, const NamedPart& named, const std::string& path) {
  std::uint64_t triangles = 0;
  for (const Instance& instance : part.instances) triangles += part.meshes[instance.mesh].triangles.size();
  if (triangles != named.triangles) return "wrong number of triangles: " + std::to_string(triangles);
  if (!path.ends_with(".stl")) return {};
  const std::vector<Triangle> expected = slow_stl(path);
  const auto& found = part.meshes[0].triangles;
  if (!std::equal(found.begin(), found.end(), expected.begin(), expected.end())) return "triangles differ";
  return {};
}

void load_part(benchmark::State& state, const NamedPart& named, const std::string& path) {
  {
    const auto part = load::load(path, {});
    const std::string wrong = part ? wrong_with(*part, named, path) : part.error().message;
    if (!wrong.empty()) return state.SkipWithError(wrong.c_str());
  }
  for (auto _ : state) {
    auto part = load::load(path, {});
    benchmark::DoNotOptimize(part);
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * std::filesystem::file_size(path)));
  state.counters["triangles/s"] =
      benchmark::Counter(named.triangles, benchmark::Counter::kIsIterationInvariantRate, benchmark::Counter::kIs1000);
}

void census_of_part(benchmark::State& state, const NamedPart& named, const std::string& path) {
  Part part;
  if (!load_on_bed(state, path, 0, 0, part)) return;
  const auto& triangles = part.meshes[0].triangles;
  const bool balanced = load::diagnose(part.meshes[0]).balanced;
  if (load::census(triangles).balanced != balanced) return state.SkipWithError("census and diagnosis disagree");
  for (auto _ : state) {
    auto census = load::census(triangles);
    benchmark::DoNotOptimize(census);
  }
  state.counters["triangles/s"] = benchmark::Counter(
      static_cast<double>(triangles.size()), benchmark::Counter::kIsIterationInvariantRate, benchmark::Counter::kIs1000);
  (void)named;
}

[[maybe_unused]] const bool load_registered = [] {
  for (const NamedPart& part : named_parts()) {
    const std::string path = model_path(part);
    if (path.empty()) continue;
    const std::string name = part.name;
    benchmark::RegisterBenchmark(("load/" + name).c_str(), load_part, part, path)->Unit(benchmark::kMillisecond)->UseRealTime();
    benchmark::RegisterBenchmark(("census/" + name).c_str(), census_of_part, part, path)
        ->Unit(benchmark::kMillisecond)
        ->UseRealTime();
  }
  return true;
}();

}  // namespace
}  // namespace lamina::bench
