// bench/named_parts.h: the real parts that stages are timed on, and how a benchmark refuses to time a wrong answer.
#pragma once

#include <benchmark/benchmark.h>

#include <cstdint>
#include <span>
#include <string>

#include "stages/data/grid.h"
#include "stages/data/mesh.h"
#include "stages/raster/raster.h"

namespace lamina::bench {

/// A file of the models folder and what any right reader finds in it.
struct NamedPart {
  const char* name;         // in the benchmark's name
  const char* file;         // in the folder that LAMINA_MODELS names
  std::uint32_t triangles;  // of all items
};

/// Easy, typical and nasty ones; all closed.
std::span<const NamedPart> named_parts();

/// A job of scripts/bench: a part of bench/make_parts.py on a square bed at 1200 dpi.
struct NamedJob {
  const char* name;
  const char* file;  // in the folder that LAMINA_BENCH_PARTS names
  std::int64_t bed;  // nm
  Nm layer;          // nm
  PixelGrid grid() const { return {{1200, bed}, {1200, bed}}; }
};
std::span<const NamedJob> named_jobs();

/// Path of a job's part; empty if LAMINA_BENCH_PARTS is not set or has no such file.
std::string job_path(const NamedJob& job);

/// Path of a part in the models folder; empty if LAMINA_MODELS is not set or has no such file.
std::string model_path(const NamedPart& part);

/// Loads a part and moves it to `x`, `y` (nm) on the bed, z = 0. Ends the benchmark with a message if that fails.
bool load_on_bed(benchmark::State& state, const std::string& path, std::int64_t x, std::int64_t y, Part& part);

/// A bed that the part fits with a millimetre to spare on each side, when it stands at (1, 1) mm.
PixelGrid snug_grid(const Part& part, std::int64_t dpi);

/// All triangles of a part in the frame of the bed, copied; for slow references.
Buffer<Triangle> flattened(const Part& part);

bool same_runs(const RunsView& a, const RunsView& b);

}  // namespace lamina::bench
