// bench/slice.cpp: contours stage by stage, on one core. Before a clock runs, the answer is checked: every chain is
// closed, and area times thickness is the volume of the mesh to what the thickness allows.
#include <benchmark/benchmark.h>

#include <cmath>

#include "bench/named_parts.h"
#include "stages/geometry/contours/nest.h"
#include "stages/geometry/contours/simplify.h"
#include "stages/slice/slice.h"

namespace lamina::bench {
namespace {

constexpr Nm kThickness = 100'000;

/// Planes of layers of 0.1 mm, in the frame of the part's first mesh.
struct Stack {
  std::vector<std::int64_t> own;
  std::uint64_t cuts = 0;  // of that mesh, in all layers
  std::string wrong;
};

Stack stack_of(const Part& part) {
  Stack stack;
  const Instance& first = part.instances.front();
  const Mesh& mesh = part.meshes[first.mesh];
  std::vector<Nm> planes;
  for (std::int64_t z = mesh.bounds.lo.z; z < mesh.bounds.hi.z; z += kThickness) {
    planes.push_back(static_cast<Nm>(z + kThickness / 2));
  }
  stack.own.assign(planes.begin(), planes.end());
  const Instance as_it_is{first.mesh, {0, 0, 0}};
  const std::uint32_t body = 0;
  slice::SliceOptions options;
  options.fill_rule = FillRule::kPositive;
  const auto slicer = slice::Slicer::build(part.meshes, {&as_it_is, 1}, {&body, 1}, planes, options);
  if (!slicer) return {{}, 0, slicer.error().message};
  slice::SectionScratch scratch;
  slice::LayerContours contours;
  double sum = 0, volume = 0, shadow = 0;
  for (std::uint32_t p = 0; p < planes.size(); ++p) {
    const auto report = slicer->layer(p, scratch, contours);
    if (!report || report->gaps.open > 0) stack.wrong = "a chain stays open";
    if (report) stack.cuts += report->cuts;
    sum += static_cast<double>(doubled_area(contours.contours)) / 2 * kThickness;
  }
  for (const Triangle& t : mesh.triangles) {
    const double nz = (static_cast<double>(t.b.x) - t.a.x) * (static_cast<double>(t.c.y) - t.a.y) -
                      (static_cast<double>(t.b.y) - t.a.y) * (static_cast<double>(t.c.x) - t.a.x);
    volume += nz / 2 * ((static_cast<double>(t.a.z) + t.b.z + t.c.z) / 3 - mesh.bounds.lo.z);
    shadow += std::abs(nz) / 2;
  }
  if (std::abs(sum - volume) > shadow * kThickness) stack.wrong = "the contours' volume is not the mesh's";
  return stack;
}

enum class Until { kIndex, kCut, kChain, kContours };

void slice_part(benchmark::State& state, Until until, const std::string& path) {
  Part part;
  if (!load_on_bed(state, path, kNmPerMm, kNmPerMm, part)) return;
  const std::span<const Triangle> triangles = part.meshes.front().triangles;
  const Stack stack = stack_of(part);
  if (!stack.wrong.empty()) return state.SkipWithError(stack.wrong.c_str());
  const slice::PlaneIndex index = slice::index_crossings(triangles, stack.own);
  Buffer<std::uint32_t> facets, group;
  slice::Cuts cuts;
  slice::ChainScratch scratch;
  ContactScratch contact;
  Contours closed, open;
  for (auto _ : state) {
    if (until == Until::kIndex) {
      const slice::PlaneIndex fresh = slice::index_crossings(triangles, stack.own);
      benchmark::DoNotOptimize(fresh.bytes());
      continue;
    }
    for (std::uint32_t p = 0; p < stack.own.size(); ++p) {
      facets.clear();
      index.append(p, facets);
      const slice::CrossedFacets crossed{triangles, nullptr, facets, part.meshes.front().closed};
      slice::cut(triangles, facets, stack.own[p], cuts);
      benchmark::DoNotOptimize(cuts.at.data());
      if (until == Until::kCut) continue;
      closed.clear();
      open.clear();
      slice::chain(crossed, cuts, stack.own[p], scratch, closed, open);
      benchmark::DoNotOptimize(closed.point.data());
      if (until == Until::kChain) continue;
      tidy(closed);
      if (!find_contacts(closed, contact, group)) group.clear();
      if (!nest(closed, FillRule::kNonzero, group)) return state.SkipWithError("the union of the contours failed");
    }
  }
  const double amount = until == Until::kIndex ? static_cast<double>(triangles.size()) : static_cast<double>(stack.cuts);
  state.counters[until == Until::kIndex ? "triangles/s" : "segments/s"] =
      benchmark::Counter(amount, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["segments"] = static_cast<double>(stack.cuts);
}

[[maybe_unused]] const bool slice_registered = [] {
  for (const NamedPart& part : named_parts()) {
    const std::string path = model_path(part), name = part.name;
    if (path.empty()) continue;
    for (const auto& [stage, until] : {std::pair{"index", Until::kIndex},
                                       {"cut", Until::kCut},
                                       {"cut+chain", Until::kChain},
                                       {"contours", Until::kContours}}) {
      benchmark::RegisterBenchmark(("slice/" + name + "/" + stage).c_str(), [until = until, path](benchmark::State& state) {
        slice_part(state, until, path);
      })->Unit(benchmark::kMillisecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace lamina::bench
