#include "pipeline/output/resume.h"

#include <fmt/core.h>
#include <tbb/parallel_for.h>
#include <unistd.h>

#include <algorithm>

#include "pipeline/output/print_program.h"
#include "stages/support/hash/hash.h"

namespace lamina::pipeline {

Result<std::vector<LayerRecord>> layers_that_hold(const std::string& directory, const std::string& manifest_name,
                                                  const ManifestHead& head) {
  std::string path = directory + "/" + manifest_name;
  if (::access(path.c_str(), F_OK) != 0) {
    path += ".part";
    if (!has_manifest_head(path)) return std::vector<LayerRecord>{};
  }

  auto manifest = read_manifest(path);
  if (!manifest) return manifest.error();
  if (!same_job(manifest->head, head)) {
    const std::string what = difference(head, manifest->head);
    return Error{Fault::kUsage, fmt::format("{}: belongs to another job ({}); choose another directory, or --overwrite", path,
                                            what.empty() ? "its parts or keys differ" : what)};
  }
  const ManifestHead& was = manifest->head;
  if (was.first_layer < head.first_layer || was.last_layer > head.last_layer) {
    return Error{Fault::kUsage,
                 fmt::format("{}: is of layers {}:{}, which {}:{} would not keep; resume with the same --layers or more, or "
                             "choose another directory and join them by lamina merge",
                             path, was.first_layer, was.last_layer, head.first_layer, head.last_layer)};
  }
  const std::vector<LayerRecord>& recorded = manifest->layers;
  std::vector<char> holds(recorded.size(), 1);
  tbb::parallel_for(std::size_t{0}, recorded.size(), [&](std::size_t i) {
    const LayerRecord& record = recorded[i];
    const auto hold = [&](const std::string& file, std::uint64_t bytes, const Hash128& hash) {
      if (file.empty()) return true;  // a format without files, a job without a machine
      const auto digest = digest_file(directory + "/" + file, bytes);
      return digest.ok() && digest->bytes == bytes && digest->hash == hash;
    };
    holds[i] = std::ranges::all_of(
                   layer_images(head, record),
                   [&](const LayerImageFile& image) { return hold(image.name, image.record.bytes, image.record.hash); }) &&
               hold(program_file_name(record.layer.index, head.program_extension), record.program.bytes, record.program.hash);
  });
  std::vector<LayerRecord> kept;
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    if (holds[i] != 0) kept.push_back(recorded[i]);
  }
  return kept;
}

}  // namespace lamina::pipeline
