#include "stages/load/threemf/model_parser.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "stages/load/text.h"
#include "stages/load/threemf/extensions.h"
#include "stages/load/threemf/roles.h"
#include "stages/load/threemf/xml.h"
#include "stages/support/text/escape.h"

namespace lamina::load {
namespace {

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

/// Takes a word from the front; empty at the end.
std::string_view take_word(std::string_view& text) {
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  std::size_t end = 0;
  while (end < text.size() && !is_space(text[end])) ++end;
  const std::string_view word = text.substr(0, end);
  text.remove_prefix(end);
  return word;
}

/// Digits alone, with or without a plus sign.
template <class Number>
bool read_whole(std::string_view text, Number& number) {
  text = trimmed(text);
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), number);
  return !text.empty() && status == std::errc() && end == text.data() + text.size();
}

constexpr std::size_t kMaxReported = 64;  // reported at most

double unit_in_mm(std::string_view unit) {
  constexpr std::pair<std::string_view, double> kUnits[] = {{"micron", 0.001}, {"millimeter", 1}, {"centimeter", 10},
                                                            {"inch", 25.4},    {"foot", 304.8},   {"meter", 1000}};
  for (const auto& [name, size] : kUnits)
    if (name == unit) return size;
  return 0;
}

constexpr std::string_view kWellKnown[] = {"Title",  "Designer",     "Description",      "Copyright",  "LicenseTerms",
                                           "Rating", "CreationDate", "ModificationDate", "Application"};
constexpr std::size_t kMaxRemembered = 4096, kLongest = 64;
constexpr std::string_view kCura = "cura:";

/// The metadata of one element. Names that violate the specification are reported: many programs write such ones, and
/// readers should ignore them.
///
/// source  3MF Consortium, Core Specification 1.3, section 3.4.1
class Metadata {
 public:
  /// A <metadata> begins. errors  it has no name
  std::string begin(const XmlReader& reader, XmlAttributes attributes, ModelPackage& package) {
    const char* const name = find_attribute(attributes, "name");
    if (name == nullptr) return "<metadata> without a name, which 3MF requires (core 3.4.1); export it again";
    name_ = name;
    text_.clear();
    const std::size_t colon = name_.find(':');
    if (colon == name_.npos && std::ranges::find(kWellKnown, name_) == std::end(kWellKnown))
      package.depart("metadata of a name that is neither of 3MF nor of a namespace (core 3.4.1)", name_);
    if (colon != name_.npos && !reader.attribute_name(name_).declared)
      package.depart("metadata whose name has a prefix that is not declared (core 3.4.1)", name_);
    if (names_.size() < kMaxRemembered && !names_.insert(name_).second)
      package.depart("metadata of one name twice (core 3.4.1)", name_);
    return {};
  }
  /// What older releases of Cura have instead.
  void begin_setting(XmlAttributes attributes) {
    const char* const key = find_attribute(attributes, "key");
    name_ = std::string(kCura) + (key != nullptr ? key : "");
    text_.clear();
  }
  /// A piece of its text; long texts are not needed.
  void text(std::string_view piece) { text_ += piece.substr(0, kLongest - std::min(kLongest, text_.size())); }
  /// It ends; an object learns what Cura says of it.
  void end(ModelObject* object) {
    std::string_view key = name_;
    if (object == nullptr || !key.starts_with(kCura)) return;
    while (key.starts_with(kCura)) key.remove_prefix(kCura.size());
    apply_cura_setting(key, text_, *object);
  }

 private:
  std::set<std::string> names_;
  std::string name_, text_;
};

struct Required {
  std::string_view element, attribute;
  std::string_view where;  // in the specifications
};

constexpr Required kRequired[] = {
    {"base", "name", "core 5.1"},
    {"base", "displaycolor", "core 5.1"},
    {"color", "color", "materials 2.1"},
    {"texture2dgroup", "texid", "materials 3"},
    {"tex2coord", "u", "materials 3.1"},
    {"tex2coord", "v", "materials 3.1"},
    {"compositematerials", "matid", "materials 4"},
    {"compositematerials", "matindices", "materials 4"},
    {"composite", "values", "materials 4.1"},
    {"multiproperties", "pids", "materials 5"},
    {"multi", "pindices", "materials 5.1"},
    {"texture2d", "path", "materials 6"},
    {"texture2d", "contenttype", "materials 6"},
};

Error wrong(std::string what) { return {Fault::kInput, std::move(what) + "; export it again"}; }

constexpr std::uint64_t kNoId = UINT64_MAX;  // of an element that is no resource

/// What is no number leads to nothing.
std::vector<std::uint64_t> read_ids(std::string_view text) {
  std::vector<std::uint64_t> ids;
  for (std::size_t at = 0; (at = text.find_first_not_of(" \t\r\n", at)) != text.npos;) {
    const std::string_view word = text.substr(at, text.find_first_of(" \t\r\n", at) - at);
    std::uint64_t& id = ids.emplace_back(kNoId);
    std::from_chars(word.data(), word.data() + word.size(), id);
    at += word.size();
  }
  return ids;
}

/// lamina prints no colours, textures and materials, but a file in which they contradict themselves is not what its program
/// meant. Checked are the attributes that have to be there, and what groups of properties refer to; not the values.
///
/// source  3MF Consortium, Core Specification 1.3, chapters 4 and 5; Materials and Properties Extension 1.2, chapters 2 to 6
class Properties {
 public:
  /// An element of a namespace of 3MF: a resource, or what stands in one.
  /// id  of the resource, or kNoId
  /// errors  kInput, without a file or line: the first thing that it lacks
  Status add(std::string_view element, XmlAttributes attributes, std::uint64_t id, std::uint64_t line) {
    for (const Required& one : kRequired) {
      if (one.element == element && find_attribute(attributes, one.attribute) == nullptr)
        return wrong(fmt::format("<{}> lacks its {}, which 3MF requires ({})", element, one.attribute, one.where));
    }
    const GroupKind kind = kind_of(element);
    if (kind == GroupKind::kNone) return {};
    if (kind == GroupKind::kTexture && !std::string_view(find_attribute(attributes, "contenttype")).starts_with("image/"))
      return wrong("<texture2d>: the content type is neither image/png nor image/jpeg (materials 6)");
    if (id != kNoId) kinds_.emplace(id, kind);
    const char* const to = find_attribute(attributes, kind == GroupKind::kTextureGroup ? "texid"
                                                      : kind == GroupKind::kComposites ? "matid"
                                                                                       : "pids");
    if (to != nullptr) references_.push_back({kind, read_ids(to), line});
    return {};
  }

  /// Once all of a file are known. errors  as add(): what refers to the wrong kind of resource
  /// line  receives its line
  Status check_references(std::uint64_t& line) const {
    for (const Reference& reference : references_) {
      line = reference.line;
      if (Status status = check(reference); !status) return status;
    }
    return {};
  }

 private:
  enum class GroupKind { kNone, kMaterials, kComposites, kColors, kTexture, kTextureGroup, kMulti };
  struct Reference {
    GroupKind from;
    std::vector<std::uint64_t> to;
    std::uint64_t line;
  };

  static GroupKind kind_of(std::string_view element) {
    if (element == "basematerials") return GroupKind::kMaterials;
    if (element == "compositematerials") return GroupKind::kComposites;
    if (element == "colorgroup") return GroupKind::kColors;
    if (element == "texture2d") return GroupKind::kTexture;
    if (element == "texture2dgroup") return GroupKind::kTextureGroup;
    return element == "multiproperties" ? GroupKind::kMulti : GroupKind::kNone;
  }

  Status check(const Reference& reference) const {
    const auto count = [&](GroupKind kind) {
      return std::ranges::count_if(reference.to, [&](std::uint64_t id) {
        const auto found = kinds_.find(id);
        return found != kinds_.end() && found->second == kind;
      });
    };
    if (reference.from == GroupKind::kTextureGroup && count(GroupKind::kTexture) != 1)
      return wrong("<texture2dgroup>: its texid leads to no <texture2d> (materials 3)");
    if (reference.from == GroupKind::kComposites && count(GroupKind::kMaterials) != 1)
      return wrong("<compositematerials>: its matid leads to no <basematerials> (materials 4)");
    if (reference.from != GroupKind::kMulti) return {};
    if (reference.to.empty()) return wrong("<multiproperties>: its pids are empty (materials 5)");
    if (count(GroupKind::kMulti) > 0)
      return wrong("<multiproperties> refers to <multiproperties>, which 3MF forbids (materials 5)");
    if (count(GroupKind::kMaterials) + count(GroupKind::kComposites) > 1)
      return wrong("<multiproperties> refers to more than one group of materials, which 3MF forbids (materials 5)");
    if (count(GroupKind::kColors) > 1)
      return wrong("<multiproperties> refers to more than one <colorgroup>, which 3MF forbids (materials 5)");
    return {};
  }

  std::map<std::uint64_t, GroupKind> kinds_;  // of resources by their ids
  std::vector<Reference> references_;
};

class ModelParser : public XmlHandler {
 public:
  ModelParser(ModelPackage& package, std::uint32_t file, std::uint64_t triangle_limit)
      : package_(package), file_(file), triangle_limit_(triangle_limit) {}

  XmlReader reader{*this};

  void start(const XmlName& name, XmlAttributes attributes) override {
    if (elements_.empty()) return model(name, attributes);
    const Element around = elements_.back();
    const bool passed = around == Element::kPassedOver || around == Element::kMetadata;
    elements_.push_back(passed ? Element::kPassedOver : element_of(name, attributes));
  }

  void end() override {
    const Element position = elements_.back();
    elements_.pop_back();
    if (position == Element::kMetadata) {
      reader.want_text(false);
      const bool of_object = elements_.size() > 1 && elements_[elements_.size() - 2] == Element::kObject;
      metadata_.back().end(of_object ? &current() : nullptr);
    }
    if (position == Element::kMetadataGroup) metadata_.pop_back();
    if (position == Element::kResources) {
      std::uint64_t line = 0;
      if (const Status status = properties_.check_references(line); !status) reader.refuse(status.error().message, line);
    }
  }
  void text(std::string_view piece) override { metadata_.back().text(piece); }

  bool has_build() const { return has_build_; }

 private:
  enum class Element {
    kModel,
    kResources,
    kProperties,
    kObject,
    kMesh,
    kVertices,
    kTriangles,
    kComponents,
    kBuild,
    kItem,
    kMetadataGroup,
    kMetadata,
    kLattice,
    kVolumes,
    kPassedOver
  };

  /// What a name without a meaning may say is not known.
  XmlName attribute_name(const char* name) {
    const XmlName is = reader.attribute_name(name);
    if (!is.declared) refuse(fmt::format("the prefix of {} is not declared; export it again", quoted(std::string_view(name))));
    return is;
  }

  Element element_of(const XmlName& name, XmlAttributes attributes) {
    const Element around = elements_.back();
    const bool is_core = name.space == core_ || name.space == kCoreNamespace;
    if (around == Element::kProperties)
      return is_core || is_material(name.space) ? property(name.local, attributes) : Element::kPassedOver;
    if (is_core) return in_core(name.local, attributes);
    if (around == Element::kItem || around == Element::kMetadataGroup) return Element::kPassedOver;
    if (!name.declared) refuse(fmt::format("the prefix of <{}> is not declared; export it again", name.local));
    return name.space.empty() ? Element::kPassedOver : in_extension(name, attributes);
  }

  Element in_core(std::string_view name, XmlAttributes attributes) {
    switch (elements_.back()) {
      case Element::kVertices:
        if (name != "vertex") break;
        vertex(attributes);
        return Element::kPassedOver;
      case Element::kTriangles:
        if (name != "triangle") break;
        triangle(attributes);
        return Element::kPassedOver;
      case Element::kComponents:
        if (name != "component") break;
        reference(name, attributes, current().components);
        return Element::kPassedOver;
      case Element::kBuild:
        if (name != "item") break;
        reference(name, attributes, package_.items);
        return Element::kItem;
      case Element::kItem:
        if (name != "metadatagroup") break;
        return metadata_group();
      case Element::kMetadataGroup:
        if (name == "metadata" || name == "setting") return metadata(name, attributes);
        break;
      case Element::kModel: {
        if (name == "metadata") return metadata(name, attributes);
        bool& there = name == "build" ? has_build_ : has_resources_;
        if (name != "build" && name != "resources") break;
        if (there) refuse(fmt::format("a second <{}>; export it again", name));
        there = true;
        pass_over_attributes(attributes);
        // The build of a file that is only referred to does not count.
        return name == "resources" ? Element::kResources : file_ == 0 ? Element::kBuild : Element::kPassedOver;
      }
      case Element::kResources:
        if (name == "basematerials") return property(name, attributes);
        if (name != "object") break;
        object(attributes);
        return Element::kObject;
      case Element::kObject:
        if (name == "metadatagroup" || name == "settings") return metadata_group();
        pass_over_attributes(attributes);
        if (name == "components") return Element::kComponents;
        if (name != "mesh") break;
        if (!current().vertices.empty()) refuse("a second mesh of an object; export it again");
        return Element::kMesh;
      case Element::kMesh:
        pass_over_attributes(attributes);
        if (name == "vertices") return Element::kVertices;
        if (name == "triangles") return Element::kTriangles;
        break;
      default: break;
    }
    if (elements_.back() == Element::kResources) resource(name, attributes);
    if (elements_.back() == Element::kModel && name == "model") refuse("a model within a model; export it again");
    if (core_ == kCoreNamespace) package_.depart("elements that it does not have, which are passed over", name);
    return Element::kPassedOver;
  }

  /// Groups of properties, and what stands in them.
  Element property(std::string_view name, XmlAttributes attributes) {
    const bool is_resource = elements_.back() == Element::kResources;
    const std::uint64_t id = is_resource ? resource(name, attributes) : kNoId;
    if (const Status status = properties_.add(name, attributes, id, reader.line()); !status) refuse(status.error().message);
    return is_resource ? Element::kProperties : Element::kPassedOver;
  }

  Element metadata_group() {
    metadata_.emplace_back();
    return Element::kMetadataGroup;
  }

  Element metadata(std::string_view name, XmlAttributes attributes) {
    Metadata& of = metadata_.back();
    if (name == "setting")
      of.begin_setting(attributes);
    else if (std::string what = of.begin(reader, attributes, package_); !what.empty())
      refuse(std::move(what));
    reader.want_text(true);
    return Element::kMetadata;
  }

  /// Of an element that has no attributes of its own that matter here.
  void pass_over_attributes(XmlAttributes attributes) {
    for (; *attributes != nullptr; attributes += 2) pass_over_attribute(reader.attribute_name(attributes[0]));
  }

  void pass_over_attribute(const XmlName& name) {
    if (!name.space.empty() && extension_of(name.space).kind == Extension::kUnknown &&
        package_.unsupported.size() < kMaxReported)
      package_.unsupported.emplace(name.space);
  }

  Element in_extension(const XmlName& name, XmlAttributes attributes) {
    const Element position = elements_.back();
    const Extension kind = extension_of(name.space).kind;
    if (position == Element::kLattice) {
      if (name.local == "beam") ++current().beams;
      return Element::kLattice;
    }
    if (position == Element::kMesh && kind == Extension::kBeams && name.local == "beamlattice") return Element::kLattice;
    if (position == Element::kVolumes) {
      if (name.local == "volume") volume(attributes);
      return Element::kPassedOver;
    }
    if (position == Element::kMesh && name.local == "volumes" && is_slic3r(name.space)) return Element::kVolumes;
    if (position == Element::kResources && is_material(name.space)) return property(name.local, attributes);
    if (position == Element::kResources) resource(name.local, attributes);
    if (position == Element::kObject && kind == Extension::kUnknown && current().content.empty())
      current().content = name.space;
    if (kind == Extension::kUnknown && package_.extensions.size() < kMaxReported) package_.extensions.emplace(name.space);
    return Element::kPassedOver;
  }

  void model(const XmlName& name, XmlAttributes attributes) {
    if (name.local != "model" || !is_core_too(name.space))
      return refuse(fmt::format("is no 3MF model: it begins with <{}>{}", name.local,
                                name.space.empty() ? "" : fmt::format(" of {}", name.space)));
    core_ = name.space;
    elements_.push_back(Element::kModel);
    for (; *attributes != nullptr; attributes += 2) {
      const std::string_view attribute = attributes[0], value = attributes[1];
      if (attribute == "unit") {
        package_.files[file_].unit_mm = unit_in_mm(value);
        if (package_.files[file_].unit_mm == 0)
          refuse(fmt::format("the unit {} is unknown to 3MF (millimeter, inch, ...); export it again", quoted(value)));
      }
      if (attribute == "requiredextensions") require(value);
      if (attribute == "xml:space") refuse("xml:space, which 3MF forbids; export it again");
      attribute_name(attributes[0]);
    }
  }

  /// The prefixes of extensions that have to be understood.
  void require(std::string_view prefixes) {
    while (true) {
      const std::string prefix(take_word(prefixes));
      if (prefix.empty()) return;
      const XmlName required = reader.attribute_name(prefix + ":");
      if (!required.declared)
        return refuse(fmt::format("requires an extension of the prefix {}, which it does not declare; export it again",
                                  quoted(std::string_view(prefix))));
      const std::string_view space = required.space;
      package_.needs_beams = package_.needs_beams || extension_of(space).kind == Extension::kBeams;
      if (extension_of(space).kind == Extension::kUnknown)
        return refuse(fmt::format("requires the extension {}, which lamina does not read; {}", extension_label(space),
                                  extension_of(space).remedy));
    }
  }

  bool read_id(std::string_view text, std::uint64_t& id) {
    if (read_whole(text, id) && id < (std::uint64_t{1} << 32)) return true;
    refuse(fmt::format("the id {} is no whole number below 2^32; export it again", quoted(text)));
    return false;
  }

  /// All resources of a file share one count.
  std::uint64_t resource(std::string_view name, XmlAttributes attributes) {
    std::uint64_t id = kNoId;
    const char* const text = find_attribute(attributes, "id");
    if (text != nullptr && read_id(text, id) && !ids_.insert(id).second)
      refuse(fmt::format("<{}>: a second resource of id {}; export it again", name, id));
    return id;
  }

  /// What Slic3r says of consecutive triangles.
  void volume(XmlAttributes attributes) {
    Volume volume;
    for (; *attributes != nullptr; attributes += 2) {
      const std::string_view attribute = attributes[0], value = attributes[1];
      if (attribute == "ts" && !read_whole(value, volume.first)) volume.first = UINT64_MAX;
      if (attribute == "te" && !read_whole(value, volume.last)) volume.last = UINT64_MAX;
      if (attribute == "modifier" && value != "0") volume.role = Role::kModifier;
    }
    if (volume.role != Role::kPart) current().volumes.push_back(std::move(volume));
  }

  void object(XmlAttributes attributes) {
    ModelObject object;
    object.file = file_;
    bool has_id = false, has_group = false, has_property = false;
    resource("object", attributes);
    for (; *attributes != nullptr; attributes += 2) {
      const std::string_view attribute = attributes[0], value = attributes[1];
      if (attribute == "id") {
        has_id = read_id(value, object.id);
      } else if (attribute == "name") {
        object.name = value;
      } else if (attribute == "pid") {
        has_group = true;
      } else if (attribute == "pindex") {
        has_property = true;
      } else if (attribute == "type") {
        if (value == "other")
          object.type = ModelObject::Type::kOther;
        else if (value == "support" || value == "solidsupport")
          object.type = ModelObject::Type::kSupport;
        else if (value == "surface")
          object.type = ModelObject::Type::kSurface;
        else if (value != "model")
          refuse(fmt::format("the type {} of an object is unknown to 3MF; export it again", quoted(value)));
      } else if (const XmlName is = attribute_name(attributes[0]); extension_of(is.space).kind == Extension::kSlices) {
        object.sliced = object.sliced || is.local == "slicestackid";
        object.low_resolution = object.low_resolution || (is.local == "meshresolution" && value == "lowres");
      } else {
        pass_over_attribute(is);
      }
    }
    if (has_property && !has_group) refuse("an object with a pindex and no pid, which 3MF requires (core 4); export it again");
    if (!has_id) refuse("an object without an id; export it again");
    package_.object_of_id.emplace(std::pair{file_, object.id}, static_cast<std::uint32_t>(package_.objects.size()));
    package_.objects.push_back(std::move(object));
  }

  void vertex(XmlAttributes attributes) {
    std::array<double, 3> at{};
    unsigned found = 0;
    for (; *attributes != nullptr; attributes += 2) {
      const char* const name = attributes[0];
      if (name[0] < 'x' || name[0] > 'z' || name[1] != 0) continue;
      const auto axis = static_cast<unsigned>(name[0] - 'x');
      if (!parse_number(trimmed(attributes[1]), at[axis]))
        return refuse(fmt::format("the coordinate {}", not_a_number(attributes[1])));
      found |= 1u << axis;
    }
    if (found != 7) return refuse("a vertex lacks x, y or z; export it again");
    if (current().vertices.size() >= UINT32_MAX) return refuse("an object has more than 2^32 vertices");
    current().vertices.push_back(at);
  }

  void triangle(XmlAttributes attributes) {
    std::array<std::uint32_t, 3> corners{};
    unsigned found = 0;
    for (; *attributes != nullptr; attributes += 2) {
      const char* const name = attributes[0];
      if (name[0] != 'v' || name[1] < '1' || name[1] > '3' || name[2] != 0) continue;
      const auto corner = static_cast<unsigned>(name[1] - '1');
      if (!read_whole(std::string_view(attributes[1]), corners[corner]) || corners[corner] >= current().vertices.size())
        return refuse(fmt::format("a triangle names vertex {}, of {} (they count from 0); export it again",
                                  quoted(attributes[1]), current().vertices.size()));
      found |= 1u << corner;
    }
    if (found != 7) return refuse("a triangle lacks v1, v2 or v3; export it again");
    if (++package_.triangles > triangle_limit_)
      return refuse(fmt::format("contains more triangles than the limit of {}", triangle_limit_));
    current().triangles.push_back(corners);
  }

  bool read_matrix(std::string_view text, Transform& transform) {
    std::array<double, 12> number{};
    std::string_view rest = text;
    for (double& one : number) {
      const std::string_view word = take_word(rest);
      if (word.empty() || !parse_number(word, one) || !std::isfinite(one)) return false;
    }
    if (!trimmed(rest).empty()) return false;
    // Points are rows in 3MF, (x y z 1) * matrix, and columns here.
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t column = 0; column < 3; ++column) transform.linear[3 * row + column] = number[3 * column + row];
      transform.translation[row] = number[9 + row] * package_.files[file_].unit_mm;
    }
    return true;
  }

  void reference(std::string_view what, XmlAttributes attributes, std::vector<ObjectReference>& to) {
    ObjectReference reference{file_, 0, 0, {}, reader.line()};
    bool has_id = false;
    for (; *attributes != nullptr; attributes += 2) {
      const std::string_view attribute = attributes[0], value = attributes[1];
      if (attribute == "objectid") {
        has_id = read_id(value, reference.id);
      } else if (attribute == "transform") {
        if (!read_matrix(value, reference.transform))
          refuse(fmt::format("the transform {} is not of 12 numbers; export it again", quoted(value)));
      } else if (attribute == "printable") {
        reference.printable = trimmed(value) != "0" && trimmed(value) != "false";  // either way to write a boolean of XML
      } else if (const XmlName is = attribute_name(attributes[0]); is.space == kProductionNamespace && is.local == "path") {
        reference.file = package_.file_of(part_name(value));
      }
    }
    if (!has_id) refuse(fmt::format("<{}> without an objectid; export it again", what));
    to.push_back(reference);
  }

  void refuse(std::string what) { reader.refuse(std::move(what)); }
  ModelObject& current() { return package_.objects.back(); }

  ModelPackage& package_;
  std::uint32_t file_;
  std::uint64_t triangle_limit_;
  std::string core_;               // the namespace of <model>
  std::vector<Element> elements_;  // of the elements that are open
  std::set<std::uint64_t> ids_;    // of all resources of this file
  Properties properties_;
  std::vector<Metadata> metadata_{1};  // of the model, and of the group that is open
  bool has_resources_ = false, has_build_ = false;
};

}  // namespace

Status parse_model(const Source& source, Archive& archive, std::uint32_t file, std::uint64_t triangle_limit,
                   ModelPackage& package) {
  const std::string name = package.files[file].name;
  if (!archive.has(name))
    return source.error(fmt::format("names {}, which the file does not contain; export it again", name.substr(1)));
  ModelParser parser(package, file, triangle_limit);
  if (const Status read = archive.read_xml(name, parser.reader); !read) return read;
  if (file == 0 && !parser.has_build()) return source.error(fmt::format("{} has no <build>; export it again", name.substr(1)));
  return {};
}

}  // namespace lamina::load
