// bench/write_g4.cpp: the G4 encoder alone, on rows of known kinds; what it writes is first decoded by libtiff.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <random>
#include <string>

#include "bench/named_parts.h"
#include "stages/read/image.h"
#include "stages/write/file.h"
#include "stages/write/g4/encode.h"
#include "stages/write/image_format.h"

namespace lamina::bench {
namespace {

constexpr std::uint32_t kEdges = 40;

enum class Kind { kSlopes, kParts, kRandom, kSame, kEmpty };

/// kSlopes  40 changes a row, each up to 2 pixels from the one above: walls of a part
/// kParts   the same, with runs that begin and end: features of a part
/// kRandom  about 40 changes a row that have nothing to do with the row above
/// kSame    40 changes a row, all rows alike
Runs image_of(Kind kind, std::uint32_t side) {
  std::mt19937 random(1);
  Runs runs;
  runs.columns = side;
  runs.row_offset.push_back(0);
  const double spacing = static_cast<double>(side) / kEdges;
  double edge[kEdges], slope[kEdges];
  for (std::uint32_t i = 0; i < kEdges; ++i) {
    edge[i] = (i + 0.5) * spacing;
    slope[i] = (static_cast<double>(random() % 401) - 200) / 100;
  }
  for (std::uint32_t row = 0; row < side && kind != Kind::kEmpty; ++row) {
    std::uint32_t column = 0;
    for (std::uint32_t i = 0; i < kEdges; ++i) {
      if (kind == Kind::kRandom) {
        column += 1 + static_cast<std::uint32_t>(random() % static_cast<unsigned>(2 * spacing - 2));
        if (column > side || (i == kEdges - 1 && runs.change.size() % 2 == 0)) break;
        runs.change.push_back(column);
        continue;
      }
      const bool gone = kind == Kind::kParts && (row / 37 + i / 2) % 7 == 0;
      if (!gone) runs.change.push_back(static_cast<std::uint32_t>(edge[i]));
      if (kind == Kind::kSame) continue;
      edge[i] += slope[i];
      if (std::abs(edge[i] - (i + 0.5) * spacing) > 0.4 * spacing) slope[i] = -slope[i];
    }
    if (runs.change.size() % 2 != 0) runs.change.pop_back();
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  runs.row_offset.resize(side + 1, 0);
  return runs;
}

/// Empty if libtiff decodes the encoder's strip to the runs.
std::string wrong_with(const Runs& runs) {
  write::Bytes file;
  if (auto encoded = write::find_image_format("tiff-g4")->make_encoder()->encode(runs, 1200, 1200, file); !encoded) {
    return encoded.error().message;
  }
  const std::string path = (std::filesystem::temp_directory_path() / "lamina-bench-g4.tif").string();
  if (auto written = write::write_file(path, file); !written) return written.error().message;
  const auto image = read::image(path);
  std::filesystem::remove(path);
  if (!image) return image.error().message;
  return same_runs(image->runs, runs) ? "" : "libtiff decodes other pixels";
}

void encode_g4(benchmark::State& state, Kind kind, std::uint32_t side) {
  const Runs runs = image_of(kind, side);
  const std::string wrong = wrong_with(runs);
  if (!wrong.empty()) return state.SkipWithError(wrong.c_str());
  write::g4::Encoder encoder;
  write::Bytes file;
  std::size_t bytes = 0;
  for (auto _ : state) benchmark::DoNotOptimize(bytes = encoder.encode(runs, file, 0));
  using benchmark::Counter;
  state.counters["px/s"] = Counter(double{1} * side * side, Counter::kIsIterationInvariantRate);
  state.counters["changes/s"] = Counter(static_cast<double>(runs.change.size()), Counter::kIsIterationInvariantRate);
  state.counters["file_bytes"] = static_cast<double>(bytes);
}

BENCHMARK_CAPTURE(encode_g4, slopes, Kind::kSlopes, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_g4, parts, Kind::kParts, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_g4, random, Kind::kRandom, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_g4, same, Kind::kSame, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_g4, empty, Kind::kEmpty, 18898u)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace lamina::bench
