// stages/load/threemf/threemf.cpp: a package is opened, its models are parsed, and what its build names becomes meshes.
#include "stages/load/threemf/threemf.h"

#include <fmt/core.h>

#include <memory>
#include <optional>
#include <utility>

#include "stages/load/part_store.h"
#include "stages/load/text.h"
#include "stages/load/threemf/expansion.h"
#include "stages/load/threemf/extensions.h"
#include "stages/load/threemf/model_parser.h"
#include "stages/load/threemf/placement.h"
#include "stages/load/threemf/roles.h"

namespace lamina::load {
namespace {

/// What was passed over, for a person.
void report_of_model(const ModelPackage& model, std::vector<Note>& notes) {
  for (const std::string& space : model.extensions) {
    notes.push_back(
        {false, fmt::format("holds elements of the extension {}, which lamina does not read and the file does not require",
                            extension_label(space))});
  }
  for (const std::string& space : model.unsupported) {
    notes.push_back({false, fmt::format("holds attributes of {}, which lamina does not read and the file does not require",
                                        extension_label(space))});
  }
  for (const Departure& one : model.departures) {
    const std::string more = one.count > 1 ? fmt::format(" and {} more", one.count - 1) : "";
    notes.push_back({false, fmt::format("does not follow the 3MF specification, which does not change its geometry: {}: {}{}",
                                        one.rule, quoted(std::string_view(one.first)), more)});
  }
  if (model.has_forward_references)
    notes.push_back({false, "names objects before it holds them, against the specification; they are planned all the same"});
}

/// What a file has, regardless of the job.
struct UnplacedPackage {
  ModelPackage model;
  std::vector<Leaf> leaves;
  std::vector<Note> notes;
};

std::uint64_t bytes_of(const UnplacedPackage& package) {
  std::uint64_t bytes = sizeof(UnplacedPackage) + package.leaves.size() * sizeof(Leaf);
  for (const ModelObject& object : package.model.objects) {
    bytes += sizeof(ModelObject) + bytes_held(object.vertices) + bytes_held(object.triangles) +
             object.components.size() * sizeof(ObjectReference);
  }
  return bytes;
}

Result<UnplacedPackage> read_package(const Source& source, const LoadOptions& options) {
  Result<Archive> archive = Archive::open(source, options);
  if (!archive) return archive.error();
  UnplacedPackage package;
  ModelPackage& model = package.model;
  const Result<std::string> start = find_start_part(source, *archive, model);
  if (!start) return start.error();
  model.file_of(*start);
  // The parser adds the files that it finds named.
  for (std::uint32_t file = 0; file < model.files.size(); ++file) {
    if (const Status parsed = parse_model(source, *archive, file, options.triangle_limit, model); !parsed)
      return parsed.error();
  }
  if (model.items.empty()) return source.error("has no build items: nothing is to be printed; export it again");
  if (const Status given = apply_roles(source, *archive, model, package.notes); !given) return given.error();
  if (const Status known = resolve_references(source, model, options.triangle_limit); !known) return known.error();
  report_of_model(model, package.notes);
  Result<std::vector<Leaf>> leaves = expand_build(source, model, package.notes);
  if (!leaves) return leaves.error();
  package.leaves = std::move(*leaves);
  return package;
}

/// From the store, if it has the file.
Result<std::shared_ptr<const UnplacedPackage>> package_of(const Source& source, const LoadOptions& options) {
  const std::string path(source.path());
  const std::string key = fmt::format("3mf {} {} {}", options.triangle_limit, options.expanded_limit, path);
  const std::optional<FileStamp> stamp = options.store ? source.stamp() : std::nullopt;
  if (stamp) {
    if (auto known = options.store->find<UnplacedPackage>(key, *stamp)) return known;
  }
  Result<UnplacedPackage> read = read_package(source, options);
  if (!read) return read.error();
  auto package = std::make_shared<const UnplacedPackage>(std::move(*read));
  if (stamp) options.store->add(key, path, *stamp, package, bytes_of(*package));
  return package;
}

}  // namespace

Result<Package> read_3mf(const Source& source, const LoadOptions& options) {
  const auto unplaced = package_of(source, options);
  if (!unplaced) return unplaced.error();
  Package package;
  package.notes = (*unplaced)->notes;
  const Status placed = snap_leaves(source, (*unplaced)->model, (*unplaced)->leaves, options, package);
  return placed ? Result<Package>(std::move(package)) : placed.error();
}

}  // namespace lamina::load
