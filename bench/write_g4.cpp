// bench/write_g4.cpp: the G4 and PNG encoders and the G4 decoder alone, on rows of known kinds; what they write is first
// decoded by libtiff and libpng. PNG's time is reported next to that of zlib at its fastest for the same bits, that of the
// decoder next to libtiff's, which decodes into rows of bits that become runs.
#include <benchmark/benchmark.h>
#include <fcntl.h>
#include <zlib.h>

#include <chrono>
#include <cstring>
#include <filesystem>
#include <random>
#include <string>

#include "bench/named_parts.h"
#include "stages/formats/g4/decode.h"
#include "stages/formats/g4/encode.h"
#include "stages/formats/image_format.h"
#include "stages/formats/images/image.h"
#include "stages/geometry/bits.h"
#include "stages/support/io/file.h"
#include "stages/support/late/tiff.h"

namespace lamina::bench {
namespace {

constexpr std::uint32_t kEdges = 40;

enum class Kind { kFew, kSlopes, kParts, kRandom, kSame, kEmpty };

/// kFew     2 changes a row, each up to 2 pixels from the one above: a slender part
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
    for (std::uint32_t i = 0; i < (kind == Kind::kFew ? 2 : kEdges); ++i) {
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

/// Seconds that libtiff takes for a file of one image; what it decodes. 0 if it cannot.
double libtiff_seconds(const std::string& path, std::uint32_t columns, std::uint32_t rows, Runs& runs) {
  const auto start = std::chrono::steady_clock::now();
  std::string message;
  const auto options = strict_tiff_options(message);
  const TiffHandle tiff(options ? TIFFFdOpenExt(::open(path.c_str(), O_RDONLY | O_CLOEXEC), path.c_str(), "rC", options.get())
                                : nullptr);
  if (tiff == nullptr) return 0;
  RunsBuilder builder(columns);
  formats::Bytes row(row_bytes(columns));
  for (std::uint32_t r = 0; r < rows; ++r) {
    if (TIFFReadScanline(tiff.get(), row.data(), r, 0) < 0 || !message.empty() || !builder.add_row(row, false)) return 0;
  }
  runs = builder.finish();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Empty if the format's library decodes the file to the runs.
std::string wrong_with(std::string_view id, const Runs& runs, double* by_libtiff = nullptr) {
  const formats::ImageFormat& format = *formats::find_image_format(id);
  formats::Bytes file;
  if (auto encoded = format.make_encoder()->encode(runs, 1200, 1200, file); !encoded) return encoded.error().message;
  const auto path = (std::filesystem::temp_directory_path() / "lamina-bench-runs").string() + std::string(format.extension);
  if (auto written = write_file(path, file); !written) return written.error().message;
  const auto image = formats::image(path);
  Runs decoded;
  const double seconds = id == "tiff-g4" ? libtiff_seconds(path, runs.columns, runs.view().rows(), decoded) : 1;
  if (by_libtiff != nullptr) *by_libtiff = seconds;
  std::filesystem::remove(path);
  if (!image) return image.error().message;
  if (id == "tiff-g4" && (seconds == 0 || !same_runs(decoded, runs))) return "libtiff decodes other pixels";
  return same_runs(image->runs, runs) ? "" : "other pixels are decoded";
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Rows of bits without a filter through zlib, level 1 and run lengths.
double zlib_seconds(const Runs& runs) {
  const auto start = std::chrono::steady_clock::now();
  z_stream stream{};
  if (deflateInit2(&stream, 1, Z_DEFLATED, MAX_WBITS, 8, Z_RLE) != Z_OK) return 0;
  formats::Bytes row(1 + row_bytes(runs.columns)), capacity(64 * 1024);
  for (std::uint32_t r = 0; r < runs.view().rows(); ++r) {
    row[0] = std::byte{0};
    expand_row(runs.view().row(r), std::span(row).subspan(1));
    stream.next_in = reinterpret_cast<Bytef*>(row.data());
    stream.avail_in = static_cast<uInt>(row.size());
    do {
      stream.next_out = reinterpret_cast<Bytef*>(capacity.data());
      stream.avail_out = static_cast<uInt>(capacity.size());
      deflate(&stream, r + 1 == runs.view().rows() ? Z_FINISH : Z_NO_FLUSH);
    } while (stream.avail_out == 0);
  }
  deflateEnd(&stream);
  return seconds_since(start);
}

void set_counters(benchmark::State& state, const Runs& runs, std::size_t bytes) {
  using benchmark::Counter;
  const auto kPer = Counter::kIsIterationInvariantRate | Counter::kInvert;  // seconds, the unit of the report
  const double rows = runs.view().rows(), changes = static_cast<double>(runs.change.size());
  state.counters["px/s"] = Counter(rows * runs.columns, Counter::kIsIterationInvariantRate);
  state.counters["a_row"] = Counter(rows, kPer);
  if (changes > 0) state.counters["a_change"] = Counter(changes, kPer);
  state.counters["file_bytes"] = static_cast<double>(bytes);
}

void encode_g4(benchmark::State& state, Kind kind, std::uint32_t side) {
  const Runs runs = image_of(kind, side);
  const std::string wrong = wrong_with("tiff-g4", runs);
  if (!wrong.empty()) return state.SkipWithError(wrong.c_str());
  formats::g4::Encoder encoder;
  formats::Bytes file;
  std::size_t bytes = 0;
  for (auto _ : state) benchmark::DoNotOptimize(bytes = encoder.encode(runs, file, 0));
  set_counters(state, runs, bytes);
}

void decode_g4(benchmark::State& state, Kind kind, std::uint32_t side) {
  const Runs runs = image_of(kind, side);
  double by_libtiff = 0;
  const std::string wrong = wrong_with("tiff-g4", runs, &by_libtiff);
  if (!wrong.empty()) return state.SkipWithError(wrong.c_str());
  formats::Bytes file, coded;
  file.resize(formats::g4::Encoder().encode(runs, file, 0));
  formats::G4Decoder decoder;
  Runs decoded;
  const auto start = std::chrono::steady_clock::now();
  for (auto _ : state) {
    coded = file;
    decoded.columns = side;
    decoded.row_offset.assign(1, 0);
    decoded.change.clear();
    if (!decoder.append(coded, {side, side, false, false}, decoded)) return state.SkipWithError("cannot be decoded");
  }
  state.counters["libtiff_times"] = by_libtiff * static_cast<double>(state.iterations()) / seconds_since(start);
  if (!same_runs(decoded, runs)) return state.SkipWithError("other pixels are decoded");
  set_counters(state, runs, file.size());
}

void encode_png(benchmark::State& state, Kind kind, std::uint32_t side) {
  const Runs runs = image_of(kind, side);
  const std::string wrong = wrong_with("png", runs);
  if (!wrong.empty()) return state.SkipWithError(wrong.c_str());
  const double by_zlib = zlib_seconds(runs);
  const auto encoder = formats::find_image_format("png")->make_encoder();
  formats::Bytes file;
  const auto start = std::chrono::steady_clock::now();
  for (auto _ : state) benchmark::DoNotOptimize(encoder->encode(runs, 1200, 1200, file));
  state.counters["zlib_times"] = by_zlib * static_cast<double>(state.iterations()) / seconds_since(start);
  set_counters(state, runs, file.size());
}

BENCHMARK_CAPTURE(encode_g4, few, Kind::kFew, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_g4, slopes, Kind::kSlopes, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_g4, parts, Kind::kParts, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_g4, random, Kind::kRandom, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_g4, same, Kind::kSame, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_g4, empty, Kind::kEmpty, 18898u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(decode_g4, few, Kind::kFew, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(decode_g4, slopes, Kind::kSlopes, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(decode_g4, parts, Kind::kParts, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(decode_g4, random, Kind::kRandom, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(decode_g4, same, Kind::kSame, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(decode_g4, empty, Kind::kEmpty, 18898u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_png, few, Kind::kFew, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_png, slopes, Kind::kSlopes, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_png, parts, Kind::kParts, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_png, random, Kind::kRandom, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_png, same, Kind::kSame, 4725u)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_png, empty, Kind::kEmpty, 18898u)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace lamina::bench
