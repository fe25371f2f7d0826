#include "pipeline/check/verify.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <optional>

#include "pipeline/check/replay_job.h"
#include "pipeline/check/verify_paths.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/manifest.h"
#include "pipeline/output/print_program.h"
#include "stages/data/hash.h"
#include "stages/raster/materials.h"
#include "stages/read/image.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFaultsTold = 20;

void add_fault(VerifyReport& report, std::string fault) {
  if (report.faults.size() < kFaultsTold) report.faults.push_back(std::move(fault));
  ++report.fault_count;
}

// What all layers of a directory are compared by.
struct Inspection {
  std::string directory;
  const ManifestHead& head;
  bool quick;
  std::optional<replay::VirtualMachine> machine;  // if there are programs to replay
  std::mutex adding;
  VerifyReport& report;
};

// Which vats have to feed a layer, a bit each, by the profile's rule.
std::uint32_t vats_wanted(const Machine& machine, const ManifestHead& head, const LayerRecord& record) {
  const std::size_t first =
      std::ranges::find_if(record.images, [](const ImageRecord& i) { return i.set_pixels > 0; }) - record.images.begin();
  if (first == record.images.size()) return 1u << head.materials[0].vat;
  const auto after = std::find_if(record.images.begin() + static_cast<std::ptrdiff_t>(first) + 1, record.images.end(),
                                  [](const ImageRecord& i) { return i.set_pixels > 0; });
  if (after == record.images.end()) return 1u << head.materials[first].vat;
  switch (machine.powder.vat_rule) {
    case VatRule::kFirst: return 1;
    case VatRule::kSecond: return 2;
    case VatRule::kBoth: return 3;
    case VatRule::kMajority: return 1u << head.materials[after->set_pixels > record.images[first].set_pixels ? 1 : 0].vat;
    case VatRule::kRefuse: break;
  }
  return 0;
}

std::string vats_text(std::uint32_t vats) {
  constexpr const char* kTexts[] = {"no vat feeds", "the first vat feeds", "the second vat feeds", "both vats feed"};
  return kTexts[vats & 3];
}

// Empty, or what is wrong with a layer's print program. A program whose hash differs is replayed all the same, since
// that tells where it differs.
std::string fault_of_program(Inspection& inspection, const LayerRecord& record, const RunsView* image) {
  const std::string name = program_file_name(record.layer.index, inspection.head.program_extension);
  if (name.empty()) return {};
  const std::string path = (fs::path(inspection.directory) / name).string();
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return fmt::format("{}: is missing", name);
  const Result<FileDigest> digest = digest_file(path);
  if (!digest) return digest.error().message;
  const bool same = digest->bytes == record.program.bytes && digest->hash == record.program.hash;
  if (image != nullptr && inspection.machine) {
    const auto replay = inspection.machine->replay(program_of_layer(inspection.directory, inspection.head, record.layer.index),
                                                   record.layer, *image, record.program.moved, record.program.lost);
    if (!replay) return fmt::format("{}: {}", name, replay.error().message);
    if (same && replay->drops != record.program.drops) {
      return fmt::format("{}: {} drops, the manifest says {}", name, replay->drops, record.program.drops);
    }
    if (same && !inspection.head.materials.empty()) {
      const std::uint32_t wanted = vats_wanted(inspection.machine->profile(), inspection.head, record);
      if (replay->vats != wanted) {
        return fmt::format("{}: layer {}: {} where {} has to", name, record.layer.index, vats_text(replay->vats),
                           vats_text(wanted));
      }
    }
    const std::lock_guard lock(inspection.adding);
    inspection.report.replay.add(*replay);
    ++inspection.report.replayed;
  }
  return same ? std::string()
              : fmt::format("{}: layer {}: its content is not what was written{}", name, record.layer.index,
                            image != nullptr ? ", though it prints the same" : "");
}

// Empty, or what is wrong with an image; what it sets is added to `whole`.
std::string fault_of_image(const ManifestHead& head, const std::string& path, const LayerImageFile& file, Runs& whole) {
  const std::string& name = file.name;
  Result<read::Image> image = read::image(path);
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
  if (set != file.record.set_pixels) {
    return fmt::format("{}: {} set pixels, the manifest says {}", name, set, file.record.set_pixels);
  }
  if (!raster::add_image(std::move(image->runs), whole))
    return fmt::format("{}: sets pixels that another material's image sets as well", name);
  return {};
}

std::string fault_of_layer(Inspection& inspection, const LayerRecord& record) {
  if (inspection.head.extension.empty()) return fault_of_program(inspection, record, nullptr);  // a format without files
  Runs whole;  // what is jetted, of whatever material
  for (const LayerImageFile& file : layer_images(inspection.head, record)) {
    const std::string path = (fs::path(inspection.directory) / file.name).string();
    std::error_code error;
    if (!fs::is_regular_file(path, error)) return fmt::format("{}: is missing", file.name);
    const Result<FileDigest> digest = digest_file(path);
    if (!digest) return digest.error().message;
    if (digest->bytes != file.record.bytes) {
      return fmt::format("{}: {} bytes, the manifest says {}", file.name, digest->bytes, file.record.bytes);
    }
    if (digest->hash != file.record.hash) return fmt::format("{}: its content is not what was written", file.name);
    if (inspection.quick) continue;
    if (std::string what = fault_of_image(inspection.head, path, file, whole); !what.empty()) return what;
  }
  const RunsView view = whole;
  return fault_of_program(inspection, record, inspection.quick ? nullptr : &view);
}

// Finds the machine again that the programs were written for.
void prepare_replay(Inspection& inspection) {
  auto built = machine_of_job(inspection.directory, inspection.head);
  if (!built) return add_fault(inspection.report, built.error().message);
  inspection.machine = std::move(*built);
  inspection.report.machine = inspection.machine->profile().name;
}

// The programs before the first and behind the last layer.
void check_frame(const std::string& directory, const ManifestHead& head, VerifyReport& report) {
  for (const auto& [stem, hash] : {std::pair{"start", head.program_start}, {"end", head.program_end}}) {
    const std::string name = fmt::format("program/{}{}", stem, head.program_extension);
    const std::string path = (fs::path(directory) / name).string();
    std::error_code error;
    if (!fs::is_regular_file(path, error)) {
      add_fault(report, name + ": is missing");
      continue;
    }
    const Result<FileDigest> digest = digest_file(path);
    if (!digest) {
      add_fault(report, digest.error().message);
    } else if (digest->hash != hash) {
      add_fault(report, name + ": its content is not what was written");
    }
  }
}

// Sums that need the profile.
void finish_replay(const Inspection& inspection) {
  if (!inspection.machine || inspection.report.replayed == 0) return;
  VerifyReport& report = inspection.report;
  const Machine& machine = inspection.machine->profile();
  const double side = machine.bed.size_mm[0] * machine.bed.size_mm[1];
  const double area = machine.bed.shape == BedShape::kRound ? side * 3.14159265358979 / 4 : side;
  report.binder_mm3 = static_cast<double>(report.replay.drops) * machine.head.drop_pl * 1e-6;
  report.powder_mm3 = (report.replay.fed_mm[0] + report.replay.fed_mm[1]) * area * machine.powder.packing;
  report.coverage = static_cast<double>(report.replay.drops) / static_cast<double>(report.replayed) /
                    static_cast<double>(inspection.head.grid.columns()) / static_cast<double>(inspection.head.grid.rows());
}

void check_layers(const std::string& directory, const Manifest& manifest, bool quick, VerifyReport& report) {
  Inspection inspection{directory, manifest.head, quick, std::nullopt, {}, report};
  if (!manifest.head.machine.empty()) {
    prepare_replay(inspection);
    check_frame(directory, manifest.head, report);
  }
  // In pieces, so that messages stay in layer order and cost no string for each of a hundred thousand layers.
  constexpr std::size_t kPiece = 1024;
  std::vector<std::string> faults(std::min(kPiece, manifest.layers.size()));
  for (std::size_t first = 0; first < manifest.layers.size(); first += kPiece) {
    const std::size_t count = std::min(kPiece, manifest.layers.size() - first);
    tbb::parallel_for(std::size_t{0}, count,
                      [&](std::size_t i) { faults[i] = fault_of_layer(inspection, manifest.layers[first + i]); });
    for (std::size_t i = 0; i < count; ++i) {
      const LayerRecord& record = manifest.layers[first + i];
      report.bytes += record.bytes + record.program.bytes;
      report.moved += record.program.moved;
      report.lost += record.program.lost;
      if (!faults[i].empty()) add_fault(report, std::move(faults[i]));
    }
  }
  report.layers += manifest.layers.size();
  finish_replay(inspection);
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
        const ManifestHead& head = manifest.head;
        LayerRecord record;
        record.layer.index = index;
        named = named || (index >= head.first_layer && index < head.first_layer + manifest.layers.size() &&
                          std::ranges::any_of(layer_images(head, record),
                                              [&](const LayerImageFile& image) { return image.name == "layers/" + name; }));
      }
    }
    if (!named) strays.push_back(name);
  }
  for (std::string& name : strays) name = "layers/" + name;
  for (fs::directory_iterator entry(fs::path(directory) / "program", error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    std::uint32_t index = 0;
    bool partial = false, named = false;
    const bool layer = read_program_file_name(name, index, partial);
    for (const Manifest& manifest : manifests) {
      const ManifestHead& head = manifest.head;
      named = named || (!head.machine.empty() &&
                        (layer ? !partial && index >= head.first_layer && index < head.first_layer + manifest.layers.size() &&
                                     program_file_name(index, head.program_extension) == "program/" + name
                               : name == "machine.toml" || name == "start" + head.program_extension ||
                                     name == "end" + head.program_extension));
    }
    if (!named) strays.push_back("program/" + name);
  }
  std::sort(strays.begin(), strays.end());
  for (const std::string& name : strays) add_fault(report, fmt::format("{}: no manifest names it", name));
}

/// A file of toolpaths, by the manifest beside it.
Result<VerifyReport> verify_file(const std::string& path) {
  const std::string manifest_path = path + ".json";
  std::error_code error;
  if (!fs::is_regular_file(manifest_path, error)) {
    const bool begun = fs::is_regular_file(manifest_path + ".part", error);
    return Error{
        Fault::kVerification,
        fmt::format("{}: {}", path,
                    begun ? "job was interrupted; run again with --resume"
                          : fmt::format("has no manifest beside it ({}); it is no file of lamina extrude", manifest_path))};
  }
  const auto manifest = read_manifest(manifest_path);
  if (!manifest) return manifest.error();
  const fs::path folder = fs::path(path).parent_path();
  return verify_paths(path, folder.empty() ? "." : folder.string(), *manifest);
}

}  // namespace

Result<VerifyReport> verify(const std::string& directory, const VerifyOptions& options) {
  std::error_code error;
  if (fs::is_regular_file(directory, error)) return verify_file(directory);
  if (!fs::is_directory(directory, error)) {
    return Error{Fault::kUsage, fmt::format("{}: no such directory or file; name what lamina jet, lamina slice or lamina "
                                            "extrude wrote",
                                            directory)};
  }
  const std::string whole = (fs::path(directory) / "manifest.json").string();
  if (product_of_manifest(whole) == Product::kContours) {
    const auto manifest = read_manifest(whole);
    if (!manifest) return manifest.error();
    return verify_paths(directory, directory, *manifest);
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
