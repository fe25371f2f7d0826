#include "pipeline/check/stream.h"

#include <fmt/format.h>

#include <filesystem>

#include "pipeline/job/errors.h"
#include "pipeline/manifest/compare.h"
#include "pipeline/output/print_program.h"
#include "stages/support/io/compressed.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

/// errors  as stream_program
Result<Manifest> manifest_to_stream(const std::string& directory) {
  std::error_code error;
  if (!fs::is_directory(directory, error)) return usage("{}: no such directory; name one that lamina jet wrote", directory);
  const std::string path = (fs::path(directory) / "manifest.json").string();
  if (!fs::exists(path, error)) {
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

class ProgramStream {
 public:
  ProgramStream(const std::string& directory, File& out) : directory_(directory), out_(out) {}

  /// max_bytes  of a file whose size is not on record
  Status add(const std::string& name, const Hash128& hash, std::optional<std::uint64_t> bytes, std::uint64_t max_bytes) {
    const std::string fault = fault_of_file(directory_, name, hash, bytes);
    if (!fault.empty()) return Error{Fault::kVerification, fmt::format("{}/{}", directory_, fault)};
    return expand_file((fs::path(directory_) / name).string(), bytes.value_or(max_bytes),
                       [&](std::span<const std::byte> piece) { return out_.append(piece); });
  }

 private:
  const std::string& directory_;
  File& out_;
};

}  // namespace

Result<StreamReport> stream_program(const std::string& directory, const std::string& output) {
  const auto manifest = manifest_to_stream(directory);
  if (!manifest) return manifest.error();
  const ManifestHead& head = manifest->head;
  const std::string end_name = "program/end" + head.program_extension;
  if (const std::string fault = fault_of_file(directory, end_name, head.program_end); !fault.empty())
    return Error{Fault::kVerification, fmt::format("{}/{}", directory, fault)};
  auto file = File::open(output, {.stream = true});
  if (!file) return file.error();
  ProgramStream stream(directory, *file);
  Status status = stream.add("program/start" + head.program_extension, head.program_start, {}, kMaxTomlBytes);
  for (std::size_t i = 0; i < manifest->layers.size() && status; ++i) {
    const LayerRecord& record = manifest->layers[i];
    const std::string name = program_file_name(record.layer.index, head.program_extension);
    status = stream.add(name, record.program.hash, record.program.bytes, 0);
  }
  if (status) status = stream.add(end_name, head.program_end, {}, kMaxTomlBytes);
  if (!status) return status.error();
  const auto written = file->finish();
  if (!written) return written.error();
  return StreamReport{directory, manifest->layers.size(), written->bytes};
}

}  // namespace lamina::pipeline
