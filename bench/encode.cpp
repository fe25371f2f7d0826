// bench/encode.cpp: one layer's runs into a file's bytes, by every format; the file is first read back and compared.
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "bench/named_parts.h"
#include "stages/formats/image_format.h"
#include "stages/formats/images/image.h"
#include "stages/support/io/file.h"

namespace lamina::bench {
namespace {

constexpr std::int64_t kDpi = 1200;

/// Empty if the file that an encoder made gives the runs back.
std::string wrong_with(const formats::Bytes& file, const formats::ImageFormat& format, const Runs& runs) {
  if (format.extension.empty()) return {};
  const auto path = (std::filesystem::temp_directory_path() / "lamina-bench-layer").string() + std::string(format.extension);
  if (auto written = write_file(path, file); !written) return written.error().message;
  const auto image = formats::image(path);
  std::filesystem::remove(path);
  if (!image) return image.error().message;
  return same_runs(image->runs, runs) ? "" : "the file does not hold the layer's pixels";
}

void encode(benchmark::State& state, const formats::ImageFormat& format, const std::string& path) {
  Part part;
  if (!load_on_bed(state, path, kNmPerMm, kNmPerMm, part)) return;
  const PixelGrid grid = snug_grid(part, kDpi);
  auto rasterizer = raster::Rasterizer::build(part.meshes, part.instances, grid, FillRule::kNonzero, false, true);
  if (!rasterizer) return state.SkipWithError(rasterizer.error().message.c_str());
  raster::LayerScratch scratch;
  Runs runs;
  rasterizer->layer(raster::Engine::kContours, static_cast<Nm>(part.bounds.height() / 3), scratch, runs);

  const auto encoder = format.make_encoder();
  formats::Bytes file;
  if (auto encoded = encoder->encode(runs, kDpi, kDpi, file); !encoded) {
    return state.SkipWithError(encoded.error().message.c_str());
  }
  const std::string wrong = wrong_with(file, format, runs);
  if (!wrong.empty()) return state.SkipWithError(wrong.c_str());
  for (auto _ : state) {
    auto encoded = encoder->encode(runs, kDpi, kDpi, file);
    benchmark::DoNotOptimize(encoded);
  }
  const double pixels = double{1} * grid.columns() * grid.rows();
  state.counters["px/s"] = benchmark::Counter(pixels, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["changes"] = static_cast<double>(runs.change.size());
  state.counters["file_bytes"] = static_cast<double>(file.size());
}

[[maybe_unused]] const bool encode_registered = [] {
  for (const NamedPart& part : named_parts()) {
    const std::string path = model_path(part);
    if (path.empty()) continue;
    for (const formats::ImageFormat& format : formats::image_formats()) {
      benchmark::RegisterBenchmark(("encode/" + std::string(part.name) + "/" + std::string(format.id)).c_str(),
                                   [&format, path](benchmark::State& state) { encode(state, format, path); })
          ->Unit(benchmark::kMicrosecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace lamina::bench
