#include "pipeline/check/stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <functional>

#include "pipeline/check/consumed.h"
#include "pipeline/job/errors.h"
#include "pipeline/manifest/compare.h"
#include "pipeline/output/print_program.h"
#include "stages/support/io/compressed.h"
#include "stages/support/io/container.h"
#include "stages/support/io/paged.h"
#include "stages/support/io/temporary.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxWholeBytes = 32 << 20;  // of a file in memory

/// errors  as stream_program
Result<Manifest> manifest_to_stream(const std::string& directory) {
  if (!is_job_folder(directory)) return usage("{}: no such directory; name one that lamina jet wrote", directory);
  const std::string path = (fs::path(directory) / "manifest.json").string();
  if (!is_file(path)) {
    return Error{Fault::kVerification, fmt::format("{}: contains no manifest.json; complete the job with --resume, or join its "
                                                   "shards by lamina merge",
                                                   directory)};
  }
  auto manifest = read_manifest(path);
  if (!manifest) return manifest;
  const ManifestHead& head = manifest->head;
  if (head.machine.empty()) return usage("{}: the job has no print program; plan it with --machine", directory);
  if (head.first_layer > 0 || head.last_layer < head.layer_count || manifest->layers.size() != head.layer_count) {
    return Error{Fault::kVerification, fmt::format("{}: has {} of {} layers; plan the others and join them by lamina merge",
                                                   directory, manifest->layers.size(), head.layer_count)};
  }
  return manifest;
}

using TakeBytes = std::function<Status(std::span<const std::byte>)>;

class ProgramStream {
 public:
  ProgramStream(const std::string& directory, const TakeBytes& take) : directory_(directory), take_(take) {}

  /// bytes  of the file, if they are on record
  Status add(const std::string& name, const Hash128& hash, std::optional<std::uint64_t> bytes = {}) {
    const std::string path = (fs::path(directory_) / name).string();
    const std::uint64_t max_bytes = bytes.value_or(kMaxTomlBytes);
    const bool read = max_bytes <= kMaxWholeBytes && read_content(path, max_bytes, content_).ok();
    if (read && hash_text(content_) == hash) return take_(std::as_bytes(std::span(content_)));
    const std::string fault = fault_of_file(directory_, name, hash, bytes);
    if (!fault.empty()) return Error{Fault::kVerification, fmt::format("{}/{}", directory_, fault)};
    return expand_file(path, max_bytes, take_);
  }

 private:
  const std::string& directory_;
  const TakeBytes& take_;
  std::string content_;
};

/// first  what is left out
/// wrote  is called after the start, each layer and the end
/// errors  as stream_program
Status write_program(const std::string& directory, const Manifest& manifest, const Delivered& first, const TakeBytes& take,
                     const std::function<Status(std::uint32_t layers, bool end)>& wrote) {
  const ManifestHead& head = manifest.head;
  ProgramStream stream(directory, take);
  Status status;
  if (!first.start) {
    status = stream.add("program/start" + head.program_extension, head.program_start);
    if (status) status = wrote(0, false);
  }
  for (std::uint32_t i = first.layers; i < head.layer_count && status; ++i) {
    const LayerRecord& record = manifest.layers[i];
    status =
        stream.add(program_file_name(record.layer.index, head.program_extension), record.program.hash, record.program.bytes);
    if (status) status = wrote(i + 1, false);
  }
  if (status && !first.end) status = stream.add("program/end" + head.program_extension, head.program_end);
  return status && !first.end ? wrote(head.layer_count, true) : status;
}

}  // namespace

Result<StreamReport> stream_program(const std::string& directory, const std::string& output, bool consume) {
  if (consume && is_container(directory))
    return usage("{}: --consume deletes no files of a container; unpack it and name the folder", directory);
  if (consume && !pages_path(directory).empty())
    return usage("{}: --consume deletes no pages; leave it out, or plan the job without --container tiff", directory);
  std::optional<Claim> claim;
  if (std::error_code error; consume && fs::is_directory(directory, error)) {
    auto taken = Claim::take((fs::path(directory) / "manifest.json").string(), directory);
    if (!taken) return taken.error();
    claim.emplace(std::move(*taken));
  }
  const auto manifest = manifest_to_stream(directory);
  if (!manifest) return manifest.error();
  const ManifestHead& head = manifest->head;
  const std::string end_name = "program/end" + head.program_extension;
  if (const std::string fault = fault_of_file(directory, end_name, head.program_end); !fault.empty())
    return Error{Fault::kVerification, fmt::format("{}/{}", directory, fault)};
  const auto delivered = read_delivered(directory);
  if (!delivered) return delivered.error();
  if (!consume && delivered->layers > 0)
    return failure(Fault::kVerification, "{}: {}; continue with it", directory, delivered_text(*delivered, head.layer_count));
  auto file = File::open(output, {.stream = true});
  if (!file) return file.error();
  if (!consume) {
    const Status status = write_program(
        directory, *manifest, {}, [&](std::span<const std::byte> bytes) { return file->append(bytes); },
        [](std::uint32_t, bool) { return Status(); });
    if (!status) return status.error();
  } else {
    auto consumption = Consumption::begin(directory, *manifest, *file);
    if (!consumption) return consumption.error();
    Status status = write_program(
        directory, *manifest, *delivered, [&](std::span<const std::byte> bytes) { return consumption->write(bytes); },
        [&](std::uint32_t layers, bool end) { return consumption->wrote(layers, end); });
    const Status taken = consumption->finish();  // also of the layers before one that is refused
    if (status) status = taken;
    if (!status) return status.error();
  }
  const auto written = file->finish();
  if (!written) return written.error();
  return StreamReport{directory, head.layer_count - std::min(head.layer_count, delivered->layers), written->bytes};
}

}  // namespace lamina::pipeline
