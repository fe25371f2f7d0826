// bench/stokes.cpp: creeping flow past spheres with published drag and through a large cell of random ones, compared to what
// copying memory allows.
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <ctime>
#include <fstream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "stages/stokes/canonical.h"
#include "stages/stokes/flow.h"

namespace lamina::bench {
namespace {

constexpr std::uint32_t kFiner = 3;  // as lamina permeability cuts walls

struct Sphere {
  double x, y, z, radius;  // in sides of the cell
};

/// A cell that repeats, cut into side^3 voxels.
VoxelStack cut(const std::vector<Sphere>& spheres, std::uint32_t side) {
  VoxelStack stack(side, side, {1000, 1000, 1000}, {true, true, true});
  Runs slice;
  slice.columns = side;
  std::vector<std::uint8_t> row(side);
  const auto away = [&](std::uint32_t i, double centre) { return std::remainder((i + 0.5) / side - centre, 1.0); };
  for (std::uint32_t z = 0; z < side; ++z) {
    slice.row_offset.assign(1, 0);
    slice.change.clear();
    for (std::uint32_t y = 0; y < side; ++y) {
      std::fill(row.begin(), row.end(), 0);
      for (const Sphere& s : spheres) {
        const double dz = away(z, s.z), dy = away(y, s.y), left = s.radius * s.radius - dz * dz - dy * dy;
        if (left <= 0) continue;
        const double half = std::sqrt(left) * side, middle = s.x * side - 0.5;
        for (auto x = static_cast<std::int64_t>(std::ceil(middle - half));
             x <= static_cast<std::int64_t>(std::floor(middle + half)); ++x)
          row[static_cast<std::size_t>((x + 4 * std::int64_t{side}) % side)] = 1;
      }
      for (std::uint32_t x = 0; x <= side; ++x)
        if ((x > 0 && row[x - 1] != 0) != (x < side && row[x] != 0)) slice.change.push_back(x);
      slice.row_offset.push_back(static_cast<std::uint32_t>(slice.change.size()));
    }
    stack.append(slice);
  }
  return stack;
}

/// Regular arrays. K = drag / (6 pi mu a U): A. A. Zick, G. M. Homsy, "Stokes flow through periodic arrays of spheres", J.
/// Fluid Mech. 115 (1982), table 2; where it says `series`, 1 / K = 1 - 1.7918 c^(1/3) + c - 0.33 c^2 (0.302 for FCC): H.
/// Hasimoto, "On the periodic fundamental solutions of the Stokes equations", J. Fluid Mech. 5 (1959), whose next term is below
/// 2e-4 here.
struct SphereLattice {
  const char* name;
  int spheres;  // 1, 2 or 4 in a cell: SC, BCC, FCC
  double share, drag;
};
constexpr SphereLattice kLattices[] = {{"SC_touching", 1, 0.5236, 42.14},      {"SC_0.343", 1, 0.343, 15.4},
                                       {"SC_0.125", 1, 0.125, 4.292},          {"BCC_touching", 2, 0.6802, 162.9},
                                       {"BCC_0.027_series", 2, 0.027, 2.0441}, {"FCC_touching", 4, 0.7405, 435},
                                       {"FCC_0.027_series", 4, 0.027, 2.0439}};

double radius_of(const SphereLattice& lattice) {
  return std::cbrt(3 * lattice.share / (4 * std::numbers::pi * lattice.spheres));
}

VoxelStack cut(const SphereLattice& lattice, std::uint32_t side) {
  const double radius = radius_of(lattice), half = 0.5;
  const double x = 0.19 / side, y = 0.37 / side, z = 0.41 / side;  // off the grid, so that its symmetry does not flatter
  std::vector<Sphere> spheres = {{x, y, z, radius}};
  if (lattice.spheres == 2) spheres.push_back({x + half, y + half, z + half, radius});
  if (lattice.spheres == 4) {
    spheres.push_back({x + half, y + half, z, radius});
    spheres.push_back({x + half, y, z + half, radius});
    spheres.push_back({x, y + half, z + half, radius});
  }
  return cut(spheres, kFiner * side);
}

/// Spheres of a tenth of the side anywhere, which may overlap: about 30 % stays void.
std::vector<Sphere> random_spheres() {
  std::mt19937 random(1);
  const auto some = [&] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<Sphere> spheres(287);
  for (Sphere& s : spheres) s = {some(), some(), some(), 0.1};
  return spheres;
}

/// Of all threads: other programs lengthen it much less than the time that goes by.
double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Bytes that all threads copy in a processor second, read and written ones counted.
double copy_bandwidth(std::size_t bytes) {
  Buffer<std::uint8_t> from(bytes), to(bytes);
  std::memset(from.data(), 1, bytes);
  std::memset(to.data(), 2, bytes);
  constexpr std::size_t kPiece = 1 << 18;
  constexpr int kTimes = 8;
  const double start = processor_seconds();
  for (int i = 0; i < kTimes; ++i) {
    tbb::parallel_for(std::size_t{0}, bytes / kPiece,
                      [&](std::size_t piece) { std::memcpy(&to[piece * kPiece], &from[piece * kPiece], kPiece); });
  }
  return 2 * kTimes * static_cast<double>(bytes) / (processor_seconds() - start);
}

/// A figure of this process, bytes; 0 where the system does not report it.
double process_bytes(const std::string& name) {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with(name)) return 1024 * std::strtod(line.c_str() + name.size() + 1, nullptr);
  return 0;
}

struct Solved {
  stokes::Flow flow;
  std::uint64_t cells = 0;
  double grid_seconds = 0;
  double step_seconds = 0;  // of processors
};
Result<Solved> solve_cell(const VoxelView& fine, double tolerance) {
  Solved solved;
  const auto start = std::chrono::steady_clock::now();
  Result<stokes::Canonical> canonical = stokes::Canonical::of(fine, 2);
  if (!canonical) return canonical.error();
  const Result<stokes::Grid> grid = stokes::make_grid(canonical->view(), kFiner, 8);
  if (!grid) return grid.error();
  canonical->forget_voxels();
  solved.grid_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  solved.cells = grid->cells.size();
  stokes::Field field = stokes::field_of(grid->cells);
  stokes::FlowOptions options;
  options.tolerance = tolerance;
  const double first_step = processor_seconds();
  const Result<stokes::Flow> flow = stokes::solve(*grid, stokes::Canonical::kAxis, options, field);
  if (!flow) return flow.error();
  if (flow->residual > 2 * tolerance) return Error{Fault::kInput, fmt::format("residual {:.2g}", flow->residual)};
  solved.flow = *flow;
  solved.flow.permeability = canonical->in_box(flow->permeability);
  solved.step_seconds = processor_seconds() - first_step;
  return solved;
}

void past_spheres(benchmark::State& state, const SphereLattice& lattice) {
  const auto side = static_cast<std::uint32_t>(state.range(0));
  const VoxelStack fine = cut(lattice, side);
  for (auto _ : state) {
    const Result<Solved> solved = solve_cell(fine, 1e-4);
    if (!solved) return state.SkipWithError(solved.error().message.c_str());
    const double drag =
        side * side / (6 * std::numbers::pi * radius_of(lattice) * lattice.spheres * solved->flow.permeability[2]);
    if (std::abs(drag / lattice.drag - 1) > 0.05) return state.SkipWithError("the drag is not what is published");
    state.counters["drag"] = drag;
    state.counters["published"] = lattice.drag;
    state.counters["steps"] = solved->flow.steps;
    const double surface = 4 * std::numbers::pi * std::pow(radius_of(lattice), 2) * lattice.spheres / side;
    state.counters["error_floor"] = stokes::error_floor(1 - lattice.share, surface, kFiner);
  }
}

// A cell of random spheres to 1e-3. Voxels twice as large must have said about the same before the clock starts.
void through_cell(benchmark::State& state) {
  const auto side = static_cast<std::uint32_t>(state.range(0));
  if (side > 96 && benchmark::GetBenchmarkFilter().find(std::to_string(side)) == std::string::npos)
    return state.SkipWithError("takes minutes: name it with --benchmark_filter");
  const std::vector<Sphere> spheres = random_spheres();
  const Result<Solved> coarse = solve_cell(cut(spheres, kFiner * side / 2), 1e-3);
  const VoxelStack fine = cut(spheres, kFiner * side);
  if (!coarse) return state.SkipWithError(coarse.error().message.c_str());
  const double porosity = 1 - static_cast<double>(set_voxels(fine)) / static_cast<double>(fine.view().voxels());
  const double voids = porosity * std::pow(side, 3), copy = copy_bandwidth(std::size_t{1} << 28);
  std::ofstream("/proc/self/clear_refs") << "5";  // the peak counts from here
  const double before = process_bytes("VmRSS:");
  for (auto _ : state) {
    const Result<Solved> solved = solve_cell(fine, 1e-3);
    if (!solved) return state.SkipWithError(solved.error().message.c_str());
    const double change = solved->flow.permeability[2] / (4 * coarse->flow.permeability[2]) - 1;
    if (std::abs(change) > 0.05) return state.SkipWithError("voxels twice as large say something else");
    const double updates = static_cast<double>(solved->cells) * solved->flow.steps / solved->step_seconds;
    state.counters["porosity"] = porosity;
    state.counters["voids"] = voids;
    state.counters["steps"] = solved->flow.steps;
    state.counters["grid_seconds"] = solved->grid_seconds;
    state.counters["bytes_a_void_voxel"] = (process_bytes("VmHWM:") - before) / voids;
    state.counters["updates"] = updates;
    state.counters["copied"] = copy;
    state.counters["of_copy"] = updates * stokes::kBytesMoved / copy;
    state.counters["change_from_coarse"] = change;
  }
}

[[maybe_unused]] const bool stokes_registered = [] {
  for (const SphereLattice& lattice : kLattices) {
    benchmark::RegisterBenchmark((std::string("stokes/spheres/") + lattice.name).c_str(), past_spheres, lattice)
        ->Arg(48)
        ->Arg(64)
        ->Arg(96)
        ->Iterations(1)
        ->UseRealTime()
        ->MeasureProcessCPUTime()
        ->Unit(benchmark::kSecond);
  }
  benchmark::RegisterBenchmark("stokes/cell", through_cell)
      ->Arg(96)
      ->Arg(192)
      ->Arg(256)
      ->Iterations(1)
      ->UseRealTime()
      ->MeasureProcessCPUTime()
      ->Unit(benchmark::kSecond);
  return true;
}();

}  // namespace
}  // namespace lamina::bench
