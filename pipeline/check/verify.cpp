#include "pipeline/check/verify.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <tuple>

#include "pipeline/check/consumed.h"
#include "pipeline/check/doses.h"
#include "pipeline/check/job_files.h"
#include "pipeline/check/toolpaths.h"
#include "pipeline/job/errors.h"
#include "pipeline/manifest/compare.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/print_program.h"
#include "pipeline/report/job_cost.h"
#include "stages/data/levels.h"
#include "stages/data/shortage.h"
#include "stages/formats/images/image.h"
#include "stages/formats/tiff/pages.h"
#include "stages/replay/frame.h"
#include "stages/replay/totals.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/compressed.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/paged.h"
#include "stages/support/memory_gate.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

// The context for comparing all layers of a directory.
struct Verification {
  std::string directory;
  const ManifestHead& head;
  VerifyOptions options;
  std::optional<replay::VirtualMachine> machine;  // if there are programs to replay
  std::optional<DoseCheck> doses;
  ExpectedDrops expected;
  VerifyReport& report;

  /// Without a program to compare it with, the numbers of an image are enough.
  Keep keep() const { return head.machine.empty() && head.max_drops == 0 && is_one_bit(head) ? Keep::kCounts : Keep::kRuns; }
};

/// Memory of a layer in flight, used again by later ones.
struct LayerScratch {
  std::string text;  // of a program
  LayerDrops drops;
};

/// As many as there were layers in flight: no thread keeps what the budget has no place for.
class ScratchPool {
 public:
  std::unique_ptr<LayerScratch> take() {
    const std::scoped_lock lock(mutex_);
    if (idle_.empty()) return std::make_unique<LayerScratch>();
    auto scratch = std::move(idle_.back());
    idle_.pop_back();
    return scratch;
  }
  void give_back(std::unique_ptr<LayerScratch> scratch) {
    const std::scoped_lock lock(mutex_);
    idle_.push_back(std::move(scratch));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<LayerScratch>> idle_;
};

/// What is found in a layer.
struct Finding {
  std::string fault;                   // empty, or the first one
  std::optional<replay::Count> count;  // of its replayed program
  bool by_drops = false;               // the program is replayed drop by drop, to find the place of a fault
  bool repeat = false;                 // that is needed
};

/// "both vats feed"
std::string vats_text(std::uint32_t vats) {
  constexpr const char* kTexts[] = {"no vat feeds", "the first vat feeds", "the second vat feeds", "both vats feed"};
  return kTexts[vats & 3];
}

/// Empty, or what is wrong with the vats that feed a layer.
/// feeds  the vats that do, a bit each
std::string fault_of_feeding(const Verification& inspection, const LayerRecord& record, std::uint32_t feeds) {
  const ManifestHead& head = inspection.head;
  if (head.materials.empty()) return fault_of_one_powder(record);
  std::vector<std::uint64_t> set, unfed;
  std::vector<std::uint32_t> vats, vat_of_image;
  for (const ImageRecord& one : record.images) set.push_back(one.set_pixels), unfed.push_back(one.unfed_pixels);
  for (const JobMaterial& material : head.materials) {
    vats.push_back(material.vat);
    vat_of_image.insert(vat_of_image.end(), head.drop_images(), material.vat);
  }
  const std::uint32_t wanted =
      replay::vats_wanted(inspection.machine->profile(), record.pixels_of_materials(head.materials.size()), vats);
  if (feeds != wanted) return fmt::format("{} where {} has to", vats_text(feeds), vats_text(wanted));
  const Status status = replay::check_unfed(set, vat_of_image, unfed, feeds);
  return status ? std::string() : status.error().message;
}

// Empty, or the fault of a layer's print program. A program with the wrong hash is still replayed, because the replay
// locates the difference.
// drops  null if only its hash counts
std::string fault_of_program(const Verification& inspection, const LayerRecord& record, const LayerDrops* drops,
                             std::string& text, Finding& found) {
  const std::string name = program_file_name(record.layer.index, inspection.head.program_extension);
  if (name.empty()) return {};
  const std::string path = (fs::path(inspection.directory) / name).string();
  if (!is_file(path)) return fmt::format("{}: is missing", name);
  bool same = false;
  const auto expands_to = [&](std::uint64_t bytes) {
    return fmt::format("{}: expands to {} bytes, the manifest says {}", name, bytes, record.program.bytes);
  };
  if (drops == nullptr || !inspection.machine) {
    const Result<FileDigest> digest = digest_content(path, record.program.bytes);
    if (!digest) return in_directory(digest.error().message, path, name);
    if (is_compressed(name) && digest->bytes != record.program.bytes) return expands_to(digest->bytes);
    same = digest->bytes == record.program.bytes && digest->hash == record.program.hash;
  } else {
    const Status read = read_content(path, is_compressed(name) ? record.program.bytes : kMaxProgramBytes, text);
    if (!read) return in_directory(read.error().message, path, name);
    if (is_compressed(name) && text.size() != record.program.bytes) return expands_to(text.size());
    same = text.size() == record.program.bytes && hash_text(text) == record.program.hash;
    const auto replay_by = found.by_drops ? &replay::VirtualMachine::replay_drops : &replay::VirtualMachine::replay_words;
    const auto replay =
        (*inspection.machine.*replay_by)(text, record.layer, drops->planes(), record.program.moved, record.program.lost);
    if (!replay) {
      found.repeat = !found.by_drops;
      return fmt::format("{}: {}", name, replay.error().message);
    }
    const ProgramRecord& says = record.program;
    const replay::Count reported{.drops = says.drops,
                                 .sweeps = says.sweeps,
                                 .added = says.added_sweeps,
                                 .microseconds = says.microseconds,
                                 .added_microseconds = says.added_microseconds,
                                 .spat = says.spat};
    if (const Status counted = check_count(inspection.machine->profile(), reported, *replay); same && !counted)
      return fmt::format("{}: {}", name, counted.error().message);
    if (same) {
      std::string fault = fault_of_feeding(inspection, record, replay->vats);
      if (!fault.empty()) return fmt::format("{}: layer {}: {}", name, record.layer.index, fault);
    }
    found.count = *replay;
  }
  return same ? std::string()
              : fmt::format("{}: layer {}: its content is not what was written{}", name, record.layer.index,
                            drops != nullptr ? ", though it prints the same" : "");
}

// Empty, or the fault of the image of this number; its set pixels are added to `picture`, its levels to `sum`.
std::string fault_of_image(const Verification& inspection, const Layer& layer, std::size_t number, const LayerImageFile& file,
                           raster::DropPlanes& picture, std::uint64_t& sum) {
  const std::string& name = file.name;
  LayerPicture drops;
  Levels levels;
  const Keep keep = inspection.keep();
  auto image = read_layer_image((fs::path(inspection.directory) / name).string(), inspection.head, drops, levels, keep);
  if (!image) return image.error().message;
  const std::uint64_t own = sum_of_levels(levels);
  sum += own;
  if (const std::string what = formats::difference(*image, inspection.head.grid, file.record.set_pixels, layer); !what.empty())
    return fmt::format("{}: {}", name, what);
  if (file.record.drops > 0 && own != file.record.drops)
    return fmt::format("{}: has {} drops, the manifest says {}", name, own, file.record.drops);
  if (keep == Keep::kCounts) return {};
  const Status added = add_picture(inspection.head, number, std::move(image->runs), std::move(drops), picture);
  return added ? std::string() : fmt::format("{}: sets pixels that {}", name, added.error().message);
}

/// Empty, or what the manifest says of a layer's drops that its images do not.
std::string fault_of_drops(const ManifestHead& head, const LayerRecord& record, const LayerDrops& drops) {
  if (head.max_drops == 0) return {};
  if (drops.drops != record.drops) {
    return fmt::format("layer {}: its images have {} drops, the manifest says {}", record.layer.index, drops.drops,
                       record.drops);
  }
  if (drops.pixels == record.set_pixels && drops.maximum == record.max_drops) return {};
  return fmt::format("layer {}: its images set {} pixels with up to {} drops, the manifest says {} with {}", record.layer.index,
                     drops.pixels, drops.maximum, record.set_pixels, record.max_drops);
}

std::string fault_of_layer(const Verification& inspection, const LayerRecord& record, LayerScratch& scratch, Finding& found) {
  auto& [text, drops] = scratch;
  if (inspection.head.extension.empty())
    return fault_of_program(inspection, record, nullptr, text, found);  // a format without files
  raster::DropPlanes picture = planes_of(inspection.head);
  std::uint64_t levels = 0;
  const auto files = layer_images(inspection.head, record);
  for (std::size_t i = 0; i < files.size(); ++i) {
    const LayerImageFile& file = files[i];
    std::string fault = fault_of_file(inspection.directory, file.name, file.record.hash, file.record.bytes);
    if (!fault.empty()) return fault;
    if (inspection.options.quick) continue;
    if (std::string what = fault_of_image(inspection, record.layer, i, file, picture, levels); !what.empty()) return what;
  }
  // Without the machine, which is a fault of its own, nothing is known of drops that follow from the geometry.
  const bool unknown = inspection.head.geometry && !inspection.expected.remakes();
  if (inspection.options.quick || unknown) return fault_of_program(inspection, record, nullptr, text, found);
  if (Status status = inspection.expected.make(record.layer, picture.planes, drops); !status) return status.error().message;
  if (std::string what = ExpectedDrops::fault(inspection.head, record, drops); !what.empty()) return what;
  if (std::string what = fault_of_drops(inspection.head, record, drops); !what.empty()) return what;
  if (std::string what = inspection.doses->fault(record, drops.pixels, levels); !what.empty()) return what;
  return fault_of_program(inspection, record, &drops, text, found);
}

// Restores the machine that the programs were written for.
void prepare_replay(Verification& inspection) {
  auto built = machine_of_job(inspection.directory, inspection.head);
  if (!built) return inspection.report.add(built.error().message);
  inspection.machine = std::move(*built);
  inspection.report.machine = inspection.machine->profile().name;
  auto expected = ExpectedDrops::of(inspection.head, inspection.machine->profile());
  if (!expected) return inspection.report.add(expected.error().message);
  inspection.expected = std::move(*expected);
}

// Checks the programs before the first and after the last layer.
void check_frame(const Verification& inspection, VerifyReport& report) {
  const ManifestHead& head = inspection.head;
  for (const auto& [stem, hash, check] : {std::tuple{"start", head.program_start, &replay::check_start},
                                          std::tuple{"end", head.program_end, &replay::check_end}}) {
    const std::string name = fmt::format("program/{}{}", stem, head.program_extension);
    std::string fault = fault_of_file(inspection.directory, name, hash);
    const auto text = read_content((fs::path(inspection.directory) / name).string(), kMaxTomlBytes);
    if (inspection.machine && !inspection.options.quick && text) {
      if (const Status status = check(*inspection.machine, *text); !status)
        fault = fmt::format("{}: {}", name, status.error().message);
    }
    if (!fault.empty()) report.add(std::move(fault));
  }
}

// Sums that need the profile.
void finish_replay(const Verification& inspection, const std::optional<JobCost>& cost) {
  if (!inspection.machine || inspection.report.replayed == 0) return;
  VerifyReport& report = inspection.report;
  if (inspection.head.materials.empty() && report.replay.vats == 3) report.add("both vats feed, but the job uses one powder");
  report.material = replay::material_of(inspection.machine->profile(), report.replay);
  report.coverage = static_cast<double>(report.replay.drops) / static_cast<double>(report.replayed) /
                    static_cast<double>(inspection.head.grid.columns()) / static_cast<double>(inspection.head.grid.rows());
  report.use = {};
  cost->report(report.use);
}

/// As the program feeds, or its host.
std::optional<replay::Count> fed_of(const Verification& inspection, const LayerRecord& record,
                                    const std::optional<replay::Count>& count) {
  return inspection.machine ? replay::with_fed_by_host(inspection.machine->profile(), record.layer, count) : count;
}

/// Finds the faults of layers, as many at a time as the memory admits; those that are to be replayed drop by drop once more.
void inspect_layers(const Verification& inspection, std::span<const LayerRecord> records, MemoryGate& gate, ScratchPool& pool,
                    std::vector<Finding>& found) {
  const ManifestHead& head = inspection.head;
  const bool quick = inspection.options.quick;
  const replay::VirtualMachine* machine = quick || !inspection.machine ? nullptr : &*inspection.machine;
  const std::uint32_t planes = std::max(1u, head.max_drops);
  const auto inspect = [&](std::size_t i, std::uint64_t replay_bytes) {
    const std::uint64_t images =
        inspection.expected.remakes() ? bytes_to_make(head, records[i]) : bytes_to_read(head, records[i], inspection.keep());
    const std::uint64_t text = machine != nullptr ? 2 * records[i].program.bytes : 0;  // while it grows
    const auto pass = gate.enter(quick ? 0 : images + text + replay_bytes);
    found[i].count.reset();
    // Isolated: a thread that waits within has a pass, and must not begin another layer.
    auto scratch = pool.take();
    tbb::this_task_arena::isolate([&] { found[i].fault = fault_of_layer(inspection, records[i], *scratch, found[i]); });
    pool.give_back(std::move(scratch));
  };
  const std::uint64_t bytes = machine != nullptr ? machine->bytes_of_replay(planes) : 0;
  tbb::parallel_for(std::size_t{0}, records.size(), [&](std::size_t i) {
    found[i].by_drops = found[i].repeat = false;
    inspect(i, bytes);
  });
  tbb::parallel_for(std::size_t{0}, records.size(), [&](std::size_t i) {
    if (!found[i].repeat) return;
    found[i].by_drops = true;
    inspect(i, machine->bytes_of_drops(planes));
  });
}

void check_layers(const std::string& directory, const Manifest& manifest, const VerifyOptions& options,
                  std::optional<JobCost>& cost, std::optional<replay::VatLevels>& vats, VerifyReport& report) {
  Verification inspection{directory, manifest.head, options, std::nullopt, std::nullopt, {}, report};
  if (!manifest.head.machine.empty()) prepare_replay(inspection);
  inspection.doses.emplace(manifest.head, inspection.machine ? &inspection.machine->profile() : nullptr);
  inspection.doses->check_heights(manifest, report);
  if (!manifest.head.machine.empty()) {
    check_frame(inspection, report);
    if (!cost && inspection.machine) cost.emplace(inspection.machine->profile(), manifest);
    if (report.unfed.empty()) {
      for (const JobMaterial& material : manifest.head.materials) report.unfed.push_back({material.name});
    }
  }
  // In chunks, so that messages and sums stay in layer order without a string for each of a hundred thousand layers.
  constexpr std::size_t kPiece = 1024;
  MemoryGate gate(options.memory_bytes);
  ScratchPool pool;
  std::vector<Finding> found(std::min(kPiece, manifest.layers.size()));
  if (!vats && inspection.machine) vats.emplace(inspection.machine->profile());
  for (std::size_t first = 0; first < manifest.layers.size(); first += kPiece) {
    const std::size_t count = std::min(kPiece, manifest.layers.size() - first);
    inspect_layers(inspection, std::span(manifest.layers).subspan(first, count), gate, pool, found);
    for (std::size_t i = 0; i < count; ++i) {
      const LayerRecord& record = manifest.layers[first + i];
      report.bytes += record.bytes + record.program.bytes;
      report.moved += record.program.moved;
      report.lost += record.program.lost;
      for (std::size_t m = 0; m < report.unfed.size(); ++m)
        report.unfed[m].add(record.layer, record.image_of(m, report.unfed.size()).unfed_pixels);
      if (found[i].count) {
        report.replay.add(*found[i].count);
        cost->add(record, found[i].count->drops + found[i].count->spat, found[i].count->microseconds);
        if (found[i].fault.empty()) found[i].fault = fault_of_shares(inspection.head, record);
      }
      if (vats) {
        const Status taken = vats->take(record.layer.index, fed_of(inspection, record, found[i].count));
        if (!taken) report.add(taken.error().message);
      }
      report.replayed += found[i].count.has_value();
      if (!found[i].fault.empty()) report.add(std::move(found[i].fault));
    }
  }
  report.layers += manifest.layers.size();
  finish_replay(inspection, cost);
}

/// consumed  layers, of which a killed run may have left files
void check_strays(const std::string& directory, const std::vector<Manifest>& manifests, std::uint32_t consumed,
                  VerifyReport& report) {
  if (const std::string pages = pages_path(directory); !pages.empty() && !manifests.empty()) {
    if (std::string fault = formats::tiff::fault_of_pages(pages); !fault.empty()) report.add(std::move(fault));
    const std::string program = "program" + manifests[0].head.program_extension;
    for (const std::string& file : paged_job_files(directory)) {
      const std::string name = fs::path(file).filename().string();
      const bool of_program = name == program || name == "machine.toml";
      if (name != kPagesFile && (!of_program || manifests[0].head.machine.empty()))
        report.add(fmt::format("{}: no manifest names it", name));
    }
  }
  std::vector<LayersOfJob> jobs;
  for (const Manifest& manifest : manifests) {
    const std::uint32_t first = manifest.head.first_layer;
    jobs.push_back({&manifest.head, first, first + consumed + static_cast<std::uint32_t>(manifest.layers.size())});
  }
  for (const std::string& name : stray_files(directory, jobs)) report.add(fmt::format("{}: no manifest names it", name));
  if (!is_container(directory)) return;
  for (const std::string& name : misplaced_entries(directory)) report.add(fmt::format("{}: no manifest names it", name));
}

VerifyReport verify_paths(const std::string& name, const std::string& directory, const Manifest& manifest) {
  VerifyReport report;
  report.directory = name;
  report.layers = manifest.layers.size();
  report.bytes = compare_paths(directory, manifest, report);
  return report;
}

/// Replays a G-code file. errors  of check_toolpaths
Status replay_file(const std::string& path, const VerifyOptions& options, const ManifestHead* head, VerifyReport& report) {
  auto check = check_toolpaths(path, options.toolpaths, head, report);
  if (!check) return check.error();
  report.toolpaths = std::make_shared<ToolpathCheck>(std::move(*check));
  return {};
}

/// A file of another program, or one whose manifest is not there.
Result<VerifyReport> verify_third_party(const std::string& path, const VerifyOptions& options) {
  VerifyReport report;
  report.directory = path;
  report.recorded = false;
  std::error_code error;
  report.bytes = fs::file_size(path, error);
  if (Status status = replay_file(path, options, nullptr, report); !status) return status.error();
  report.layers = report.toolpaths->replay.totals.layers;
  return report;
}

/// A toolpath file, by the manifest next to it and by a replay.
Result<VerifyReport> verify_file(const std::string& path, const VerifyOptions& options) {
  const std::string manifest_path = path + ".json";
  if (fs::path(path).filename() == "manifest.json")
    return Error{Fault::kUsage, fmt::format("{}: is the manifest of a job; name its directory", path)};
  std::error_code error;
  if (!fs::is_regular_file(manifest_path, error)) {
    const bool begun = fs::is_regular_file(manifest_path + ".part", error);
    const bool alone = !begun && !fs::exists(fs::symlink_status(manifest_path, error));
    if (alone && !options.quick && fs::path(path).extension() != ".sml") return verify_third_party(path, options);
    return Error{Fault::kVerification,
                 fmt::format("{}: {}", path,
                             begun ? "job was interrupted; run again with --resume"
                                   : fmt::format("has no manifest next to it ({}); name a file that lamina extrude wrote",
                                                 manifest_path))};
  }
  const auto manifest = read_manifest(manifest_path);
  if (!manifest) return manifest.error();
  const fs::path folder = fs::path(path).parent_path();
  const std::string directory = folder.empty() ? "." : folder.string();
  VerifyReport recorded = verify_paths(path, directory, *manifest);
  if (options.quick || manifest->head.format != "gcode") return recorded;
  VerifyReport report;
  if (Status status = replay_file(path, options, &manifest->head, report); !status) {
    report = std::move(recorded);
    report.add(status.error().message);
    return report;
  }
  // Equal bytes have equal beads; the plan locates a difference of bytes.
  if (!recorded.ok() || !options.toolpaths.parts.empty()) {
    std::vector<std::string> folders = options.toolpaths.parts;
    folders.insert(folders.end(), {".", directory, fs::path(directory).parent_path().string()});
    auto plan = compare_with_plan(path, manifest->head, folders, options.toolpaths.machine, report);
    if (!plan) return plan.error();
    report.toolpaths->plan = std::move(*plan);
  }
  // Where a line is added all later layers differ from their records: those come last.
  report.directory = recorded.directory;
  report.layers = recorded.layers;
  report.bytes = recorded.bytes;
  for (std::string& fault : recorded.faults) report.add(std::move(fault));
  report.fault_count += recorded.fault_count - recorded.faults.size();
  return report;
}

/// The sums that unpackers of a container check.
void check_sums(const std::string& container, VerifyReport& report) {
  const auto entries = read_entries(container);
  if (!entries) return report.add(entries.error().message);
  std::vector<char> holds(entries->size());
  tbb::parallel_for(std::size_t{0}, holds.size(),
                    [&](std::size_t i) { holds[i] = has_its_sum(container, (*entries)[i]) ? 1 : 0; });
  for (std::size_t i = 0; i < holds.size(); ++i) {
    if (holds[i] == 0) report.add(fmt::format("{}: its CRC-32 in the container differs", (*entries)[i].name));
  }
}

/// Folders of the names that pages have would be read instead. errors  kVerification
Status check_pages_in_sight(const std::string& directory) {
  const std::string pages = pages_path(directory);
  for (const char* folder : {"layers", "program"}) {
    const fs::path path = fs::path(directory) / folder;
    std::error_code error;
    if (!pages.empty() && fs::exists(fs::symlink_status(path, error)))
      return failure(Fault::kVerification, "{}: hides what {} contains; remove or rename it", path.string(), pages);
  }
  return {};
}

Result<VerifyReport> verify_any(const std::string& directory, const VerifyOptions& options) {
  std::error_code error;
  if (!is_container(directory) && fs::is_regular_file(directory, error)) {
    if (!directory.ends_with(".zip")) return verify_file(directory, options);
    const auto entries = read_entries(directory);
    return entries ? failure(Fault::kVerification, "{}: contains no manifest of a job of lamina jet", directory)
                   : entries.error();
  }
  if (!is_job_folder(directory)) {
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
  if (Status status = check_pages_in_sight(directory); !status) return status.error();
  VerifyReport report;
  report.directory = directory;
  if (is_container(directory)) check_sums(directory, report);
  const std::vector<ManifestFile> files = find_manifests(directory);
  if (files.empty()) {
    return Error{Fault::kVerification, fmt::format("{}: contains no manifest.json; it is not a finished job", directory)};
  }
  std::vector<Manifest> manifests;
  std::vector<ShardRange> shards;
  std::optional<JobCost> cost;
  bool whole_job = false;  // a manifest of it is there
  bool interrupted = false;
  const auto delivered = read_delivered(directory);
  if (!delivered) return delivered.error();
  for (const ManifestFile& file : files) {
    const fs::path path = fs::path(directory) / file.name;
    const bool is_claim = file.partial && files[0].name == "manifest.json" && fs::is_empty(path, error);
    if (is_claim || (delivered->layers > 0 && file.name != "manifest.json")) continue;
    Result<Manifest> manifest = read_manifest(path.string());
    if (!manifest) return manifest.error();
    if (!manifests.empty() && !same_job(manifest->head, manifests[0].head)) {
      report.add(fmt::format("{}: belongs to another job than {} ({})", file.name, files[0].name,
                             difference(manifest->head, manifests[0].head)));
      continue;
    }
    if (file.partial) {
      interrupted = true;
      report.add(manifest->layers.empty()
                     ? fmt::format("{}: job was interrupted before its first layer; run again with --resume", file.name)
                     : fmt::format("{}: job was interrupted after layer {}; run again with --resume", file.name,
                                   manifest->layers.back().layer.index));
    }
    whole_job |= !file.shard;
    if (file.shard) shards.push_back({file.name, *file.shard, manifest->head.first_layer, manifest->head.last_layer});
    manifests.push_back(std::move(*manifest));
  }
  std::ranges::stable_sort(manifests, {}, [](const Manifest& manifest) { return manifest.head.first_layer; });
  const std::uint32_t gone = delivered->layers;
  if (gone > 0) {
    auto& layers = manifests.at(0).layers;
    report.add(delivered_text(*delivered, manifests[0].head.layer_count));
    layers.erase(layers.begin(), layers.begin() + std::min<std::ptrdiff_t>(gone, std::ssize(layers)));
  }
  std::optional<replay::VatLevels> vats;  // of all shards, one behind the other
  for (const Manifest& manifest : manifests) check_layers(directory, manifest, options, cost, vats, report);
  // An interrupted run may have finished layers without a line in its manifest.
  if (!interrupted) check_strays(directory, manifests, gone, report);
  if (!whole_job && !manifests.empty()) check_shards(shards, manifests[0].head.layer_count, report);
  return report;
}

}  // namespace

Result<VerifyReport> verify(const std::string& directory, const VerifyOptions& options) {
  take_shortage();
  auto report = verify_any(directory, options);
  const int reason = take_shortage();
  if (reason != 0 && (!report || !report->ok())) return shortage(reason, directory);
  return report;
}

}  // namespace lamina::pipeline
