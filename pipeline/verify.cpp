#include "pipeline/verify.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/hash.h"
#include "pipeline/manifest.h"
#include "pipeline/output_directory.h"
#include "stages/write/read_image.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFaultsTold = 20;

void add_fault(VerifyReport& report, std::string fault) {
  if (report.faults.size() < kFaultsTold) report.faults.push_back(std::move(fault));
  ++report.fault_count;
}

// Empty, or what is wrong with a layer's file.
std::string fault_of_image(const std::string& path, const std::string& name, const ManifestHead& head,
                           const LayerRecord& record) {
  const Result<write::LayerImage> image = write::read_image(path);
  if (!image) return image.error().message;
  const std::uint32_t columns = image->runs.columns, rows = image->runs.view().rows();
  if (columns != head.grid.columns() || rows != head.grid.rows()) {
    return fmt::format("{}: {} x {} pixels, the manifest says {} x {}", name, columns, rows, head.grid.columns(),
                       head.grid.rows());
  }
  const auto dpi_differs = [](double dpi, double recorded) {
    // PNG stores whole pixels a metre, so that 600 dpi reads as 599.999.
    return dpi != 0 && std::abs(dpi - recorded) > 0.02;
  };
  if (dpi_differs(image->dpi_x, head.grid.x.dpi()) || dpi_differs(image->dpi_y, head.grid.y.dpi())) {
    return fmt::format("{}: {} x {} dpi, the manifest says {} x {}", name, image->dpi_x, image->dpi_y, head.grid.x.dpi(),
                       head.grid.y.dpi());
  }
  const std::uint64_t set = set_pixels(image->runs);
  if (set != record.set_pixels) {
    return fmt::format("{}: {} set pixels, the manifest says {}", name, set, record.set_pixels);
  }
  return {};
}

std::string fault_of_layer(const std::string& directory, const ManifestHead& head, const LayerRecord& record,
                           bool quick) {
  const std::string name = layer_file_name(record.layer.index, head.extension);
  if (name.empty()) return {};  // a format without files
  const std::string path = (fs::path(directory) / name).string();
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return fmt::format("{}: is missing", name);
  const Result<FileDigest> digest = digest_file(path);
  if (!digest) return digest.error().message;
  if (digest->bytes != record.bytes) {
    return fmt::format("{}: {} bytes, the manifest says {}", name, digest->bytes, record.bytes);
  }
  if (digest->hash != record.hash) return fmt::format("{}: its content is not what was written", name);
  return quick ? std::string() : fault_of_image(path, name, head, record);
}

void check_layers(const std::string& directory, const Manifest& manifest, bool quick, VerifyReport& report) {
  // In pieces, so that messages stay in layer order and cost no string for each of a hundred thousand layers.
  constexpr std::size_t kPiece = 1024;
  std::vector<std::string> faults(std::min(kPiece, manifest.layers.size()));
  for (std::size_t first = 0; first < manifest.layers.size(); first += kPiece) {
    const std::size_t count = std::min(kPiece, manifest.layers.size() - first);
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
      faults[i] = fault_of_layer(directory, manifest.head, manifest.layers[first + i], quick);
    });
    for (std::size_t i = 0; i < count; ++i) {
      report.bytes += manifest.layers[first + i].bytes;
      if (!faults[i].empty()) add_fault(report, std::move(faults[i]));
    }
  }
  report.layers += manifest.layers.size();
}

void check_strays(const std::string& directory, const std::vector<Manifest>& manifests, VerifyReport& report) {
  std::vector<std::string> strays;
  std::error_code error;
  for (fs::directory_iterator entry(fs::path(directory) / "layers", error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    std::uint32_t index = 0;
    bool partial = false, named = false;
    if (read_layer_file_name(name, index, partial) && !partial) {
      for (const Manifest& manifest : manifests) {
        named = named || (index >= manifest.head.first_layer &&
                          index < manifest.head.first_layer + manifest.layers.size() &&
                          layer_file_name(index, manifest.head.extension) == "layers/" + name);
      }
    }
    if (!named) strays.push_back(name);
  }
  std::sort(strays.begin(), strays.end());
  for (const std::string& name : strays) add_fault(report, fmt::format("layers/{}: no manifest names it", name));
}

}  // namespace

Result<VerifyReport> verify(const std::string& directory, const VerifyOptions& options) {
  std::error_code error;
  if (!fs::is_directory(directory, error)) {
    return Error{Fault::kUsage, fmt::format("{}: no such directory; name one that lamina jet wrote", directory)};
  }
  VerifyReport report;
  report.directory = directory;
  const std::vector<ManifestFile> files = find_manifests(directory);
  if (files.empty()) {
    return Error{Fault::kVerification, fmt::format("{}: holds no manifest.json; it is no finished job", directory)};
  }
  std::vector<Manifest> manifests;
  bool interrupted = false;
  for (const ManifestFile& file : files) {
    Result<Manifest> manifest = read_manifest((fs::path(directory) / file.name).string());
    if (!manifest) return manifest.error();
    if (!manifests.empty() && manifest->head.id() != manifests[0].head.id()) {
      add_fault(report, fmt::format("{}: belongs to another job than {} ({})", file.name, files[0].name,
                                    difference(manifest->head, manifests[0].head)));
      continue;
    }
    if (file.partial) {
      interrupted = true;
      add_fault(report, manifest->layers.empty()
                            ? fmt::format("{}: job was interrupted before its first layer; run again with --resume", file.name)
                            : fmt::format("{}: job was interrupted after layer {}; run again with --resume", file.name,
                                          manifest->layers.back().layer.index));
    }
    manifests.push_back(std::move(*manifest));
  }
  for (const Manifest& manifest : manifests) check_layers(directory, manifest, options.quick, report);
  // An interrupted run has finished layers that its manifest does not know of yet.
  if (!interrupted) check_strays(directory, manifests, report);
  return report;
}

}  // namespace lamina::pipeline
