// stages/load/threemf/threemf.cpp: a package is opened, its models are parsed, and what its build names becomes meshes.
#include "stages/load/threemf/threemf.h"

#include <fmt/core.h>

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

}  // namespace

Result<Package> read_3mf(const Source& source, const LoadOptions& options) {
  Result<Archive> archive = Archive::open(source, options);
  if (!archive) return archive.error();
  ModelPackage model;
  const Result<std::string> start = find_start_part(source, *archive, model);
  if (!start) return start.error();
  model.file_of(*start);
  // The parser adds the files that it finds named.
  for (std::uint32_t file = 0; file < model.files.size(); ++file) {
    if (const Status parsed = parse_model(source, *archive, file, options.triangle_limit, model); !parsed)
      return parsed.error();
  }
  if (model.items.empty()) return source.error("has no build items: nothing is to be printed; export it again");
  Package package;
  if (const Status given = apply_roles(source, *archive, model, package.notes); !given) return given.error();
  if (const Status known = resolve_references(source, model, options.triangle_limit); !known) return known.error();
  report_of_model(model, package.notes);
  const Result<std::vector<Leaf>> leaves = expand_build(source, model, package.notes);
  if (!leaves) return leaves.error();
  if (const Status placed = snap_leaves(source, model, *leaves, options, package); !placed) return placed.error();
  return package;
}

}  // namespace lamina::load
