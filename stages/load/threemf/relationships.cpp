#include "stages/load/threemf/relationships.h"

#include <fmt/core.h>

#include <vector>

#include "stages/load/messages.h"
#include "stages/load/text.h"
#include "stages/load/threemf/xml.h"
#include "stages/support/text/part_name.h"

namespace lamina::load {
namespace {

constexpr std::string_view kModelRelationship = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
constexpr std::string_view kPrintTicketRelationship = "http://schemas.microsoft.com/3dmanufacturing/2013/01/printticket";
constexpr std::string_view kTextureRelationship = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dtexture";
constexpr std::string_view kThumbnailRelationship =
    "http://schemas.openxmlformats.org/package/2006/relationships/metadata/thumbnail";

struct Relationship {
  std::string type, target;
  bool external = false;
};

class RelationshipHandler : public XmlHandler {
 public:
  std::vector<Relationship> relationships;

  void start(const XmlName& name, XmlAttributes attributes) override {
    if (name.local != "Relationship") return;
    Relationship& one = relationships.emplace_back();
    for (; *attributes != nullptr; attributes += 2) {
      const std::string_view attribute = attributes[0], value = attributes[1];
      if (attribute == "Type") one.type = value;
      if (attribute == "Target") one.target = value;
      if (attribute == "TargetMode") one.external = value == "External";
    }
  }
  void end() override {}
};

Result<std::vector<Relationship>> read_relationships(const Source& source, Archive& archive, const std::string& part) {
  RelationshipHandler handler;
  XmlReader reader(handler);
  const auto faulty = [&] { return source.error(fmt::format("{}, {}", part.substr(1), reader.fault())); };
  const Status read = archive.read(part, [&](std::string_view bytes) { return reader.feed(bytes) ? Status() : faulty(); });
  if (!read) return read.error();
  if (!reader.finish()) return faulty();
  return std::move(handler.relationships);
}

/// "/3d/_rels/3dmodel.model.rels" of "/3d/3dmodel.model"
std::string relationships_of(const std::string& part) {
  const std::size_t slash = part.rfind('/') + 1;
  return part.substr(0, slash) + "_rels/" + part.substr(slash) + ".rels";
}

/// Whether a target is a whole address, which nothing within a package has.
bool leads_out(const Relationship& one) {
  const std::size_t colon = one.target.find(':');
  return one.external || (colon != 0 && colon < one.target.find_first_of("/?#"));
}

/// What a model consists of has to be in the package (core 2.1.1). Links to anything else are not for lamina.
Status check_inside(const Source& source, std::string_view part, const Relationship& one) {
  const bool of_payload = one.type == kModelRelationship || one.type == kPrintTicketRelationship ||
                          one.type == kThumbnailRelationship || one.type == kTextureRelationship;
  if (!of_payload || !leads_out(one)) return {};
  return source.error(fmt::format("{} names {}, which lies outside of the file; 3MF forbids this (core 2.1.1): export it again",
                                  part.substr(1), quoted(std::string_view(one.target))));
}

/// A second print ticket makes a file invalid; what it asks for is not for lamina.
Status check_model_relationships(const Source& source, Archive& archive, const std::string& model) {
  const std::string part = relationships_of(model);
  if (!archive.has(part)) return {};
  const auto relationships = read_relationships(source, archive, part);
  if (!relationships) return relationships.error();
  std::size_t tickets = 0;
  for (const Relationship& one : *relationships) {
    if (const Status inside = check_inside(source, part, one); !inside) return inside;
    tickets += one.type == kPrintTicketRelationship ? 1 : 0;
  }
  if (tickets > 1) return source.error("has more than one print ticket, which 3MF forbids; export it again");
  return {};
}

}  // namespace

Result<std::string> find_start_part(const Source& source, Archive& archive) {
  const std::string root = "/_rels/.rels";
  if (!archive.has(root)) return source.error("is a zip file, but no 3MF: it has no _rels/.rels; unzip it, or export it again");
  const auto relationships = read_relationships(source, archive, root);
  if (!relationships) return relationships.error();
  std::string model;
  for (const Relationship& one : *relationships) {
    const bool is_model = one.type == kModelRelationship;
    if (const Status inside = check_inside(source, root, one); !inside) return inside.error();
    const std::string target = part_name(one.target);
    const bool needed = is_model || one.type == kThumbnailRelationship;  // what others lead to is not for lamina
    if (needed && !archive.has(target))
      return source.error(fmt::format("_rels/.rels names {}, which the file does not hold; export it again",
                                      quoted(std::string_view(one.target))));
    if (is_model && !model.empty())
      return source.error("names more than one 3D model to start from, which 3MF forbids; export it again");
    if (is_model) model = target;
  }
  if (model.empty()) return source.error("is a zip file, but no 3MF: it names no 3D model; unzip it, or export it again");
  if (const Status known = check_model_relationships(source, archive, model); !known) return known.error();
  return model;
}

}  // namespace lamina::load
