#include "stages/load/threemf/model_parser.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cstring>

#include "stages/load/text.h"
#include "stages/load/threemf/archive.h"
#include "stages/load/threemf/extensions.h"

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

bool read_decimal(std::string_view text, double& number) { return parse_number(trimmed(text), number); }

double unit_in_mm(std::string_view unit) {
  constexpr std::pair<std::string_view, double> kUnits[] = {{"micron", 0.001}, {"millimeter", 1}, {"centimeter", 10},
                                                            {"inch", 25.4},    {"foot", 304.8},   {"meter", 1000}};
  for (const auto& [name, size] : kUnits)
    if (name == unit) return size;
  return 0;
}

}  // namespace

std::string ModelPackage::label(const ModelObject& object) const {
  std::string text = fmt::format("object {}", object.id);
  if (!object.name.empty()) text += fmt::format(" \"{}\"", object.name);
  return object.file == 0 ? text : fmt::format("{} in {}", text, files[object.file].name.substr(1));
}

std::uint32_t ModelPackage::file_of(const std::string& name) {
  const auto [found, is_new] = file_of_name.emplace(name, static_cast<std::uint32_t>(files.size()));
  if (is_new) files.push_back({name, 1});
  return found->second;
}

/// What a name without a meaning may say is not known.
XmlName ModelParser::attribute_name(const char* name) {
  const XmlName is = reader_->attribute_name(name);
  if (!is.declared) refuse(fmt::format("the prefix of {} is not declared; export it again", quoted(std::string_view(name))));
  return is;
}

void ModelParser::start(const XmlName& name, XmlAttributes attributes) {
  if (places_.empty()) return model(name, attributes);
  places_.push_back(places_.back() == Place::kPassedOver ? Place::kPassedOver : place_of(name, attributes));
}

ModelParser::Place ModelParser::place_of(const XmlName& name, XmlAttributes attributes) {
  if (name.space == core_ || name.space == kCoreNamespace) return in_core(name.local, attributes);
  if (!name.declared) refuse(fmt::format("the prefix of <{}> is not declared; export it again", name.local));
  return name.space.empty() ? Place::kPassedOver : in_extension(name, attributes);
}

ModelParser::Place ModelParser::in_core(std::string_view name, XmlAttributes attributes) {
  switch (places_.back()) {
    case Place::kVertices:
      if (name == "vertex") vertex(attributes);
      return Place::kPassedOver;
    case Place::kTriangles:
      if (name == "triangle") triangle(attributes);
      return Place::kPassedOver;
    case Place::kComponents:
      if (name == "component") reference(name, attributes, current().components);
      return Place::kPassedOver;
    case Place::kBuild:
      if (name == "item") reference(name, attributes, package_.items);
      return Place::kPassedOver;
    case Place::kModel: {
      bool& there = name == "build" ? has_build_ : has_resources_;
      if (name != "build" && name != "resources") break;
      if (there) refuse(fmt::format("a second <{}>; export it again", name));
      there = true;
      // The build of a file that is only referred to does not count.
      return name == "resources" ? Place::kResources : file_ == 0 ? Place::kBuild : Place::kPassedOver;
    }
    case Place::kResources:
      if (name != "object") break;
      object(attributes);
      return Place::kObject;
    case Place::kObject:
      if (name == "components") return Place::kComponents;
      if (name != "mesh") break;
      if (!current().vertices.empty()) refuse("a second mesh of an object; export it again");
      return Place::kMesh;
    case Place::kMesh:
      if (name == "vertices") return Place::kVertices;
      if (name == "triangles") return Place::kTriangles;
      break;
    default: break;
  }
  if (places_.back() == Place::kResources) resource(name, attributes);
  if (places_.back() == Place::kModel && name == "model") refuse("a model within a model; export it again");
  return Place::kPassedOver;
}

ModelParser::Place ModelParser::in_extension(const XmlName& name, XmlAttributes attributes) {
  const Place place = places_.back();
  const Extension kind = extension_of(name.space);
  if (place == Place::kLattice) {
    if (name.local == "beam") ++current().beams;
    return Place::kLattice;
  }
  if (place == Place::kMesh && kind == Extension::kBeams && name.local == "beamlattice") return Place::kLattice;
  if (place == Place::kResources) resource(name.local, attributes);
  if (place == Place::kObject && kind == Extension::kUnknown && current().content.empty()) current().content = name.space;
  if (kind == Extension::kUnknown) pass_over(name.space);
  return Place::kPassedOver;
}

void ModelParser::pass_over(std::string_view space) {
  constexpr std::size_t kMost = 64;
  if (package_.extensions.size() < kMost) package_.extensions.emplace(space);
}

void ModelParser::model(const XmlName& name, XmlAttributes attributes) {
  if (name.local != "model" || !is_core_too(name.space))
    return refuse(fmt::format("is no 3MF model: it begins with <{}>{}", name.local,
                              name.space.empty() ? "" : fmt::format(" of {}", name.space)));
  core_ = name.space;
  places_.push_back(Place::kModel);
  for (; *attributes != nullptr; attributes += 2) {
    const std::string_view attribute = attributes[0], value = attributes[1];
    if (attribute == "unit") {
      package_.files[file_].unit_mm = unit_in_mm(value);
      if (package_.files[file_].unit_mm == 0)
        refuse(fmt::format("the unit {} is none of 3MF (millimeter, inch, ...); export it again", quoted(value)));
    }
    if (attribute == "requiredextensions") require(value);
    if (attribute == "xml:space") refuse("xml:space, which 3MF forbids; export it again");
    attribute_name(attributes[0]);
  }
}

/// The prefixes of extensions that have to be understood.
void ModelParser::require(std::string_view prefixes) {
  while (true) {
    const std::string prefix(take_word(prefixes));
    if (prefix.empty()) return;
    const XmlName required = reader_->attribute_name(prefix + ":");
    if (!required.declared)
      return refuse(fmt::format("requires an extension of the prefix {}, which it does not declare; export it again",
                                quoted(std::string_view(prefix))));
    const std::string_view space = required.space;
    package_.needs_beams = package_.needs_beams || extension_of(space) == Extension::kBeams;
    if (extension_of(space) == Extension::kUnknown)
      return refuse(fmt::format("requires the extension {}, which lamina does not read; {}", extension_name(space),
                                extension_remedy(space)));
  }
}

bool ModelParser::read_id(std::string_view text, std::uint64_t& id) {
  if (read_whole(text, id) && id < (std::uint64_t{1} << 32)) return true;
  refuse(fmt::format("the id {} is no whole number below 2^32; export it again", quoted(text)));
  return false;
}

/// All resources of a file share one count.
void ModelParser::resource(std::string_view name, XmlAttributes attributes) {
  for (; *attributes != nullptr; attributes += 2) {
    std::uint64_t id = 0;
    if (std::strcmp(attributes[0], "id") != 0) continue;
    if (read_id(attributes[1], id) && !ids_.insert(id).second)
      refuse(fmt::format("<{}>: a second resource of id {}; export it again", name, id));
  }
}

void ModelParser::object(XmlAttributes attributes) {
  ModelObject object;
  object.file = file_;
  bool has_id = false;
  resource("object", attributes);
  for (; *attributes != nullptr; attributes += 2) {
    const std::string_view attribute = attributes[0], value = attributes[1];
    if (attribute == "id") {
      has_id = read_id(value, object.id);
    } else if (attribute == "name") {
      object.name = value;
    } else if (attribute == "type") {
      if (value == "other")
        object.type = ModelObject::Type::kOther;
      else if (value == "support" || value == "solidsupport" || value == "surface")
        object.type = ModelObject::Type::kSupport;
      else if (value != "model")
        refuse(fmt::format("the type {} of an object is none of 3MF; export it again", quoted(value)));
    } else if (const XmlName is = attribute_name(attributes[0]); extension_of(is.space) == Extension::kSlices) {
      object.sliced = object.sliced || is.local == "slicestackid";
      object.low_resolution = object.low_resolution || (is.local == "meshresolution" && value == "lowres");
    }
  }
  if (!has_id) refuse("an object without an id; export it again");
  package_.object_of_id.emplace(std::pair{file_, object.id}, static_cast<std::uint32_t>(package_.objects.size()));
  package_.objects.push_back(std::move(object));
}

void ModelParser::vertex(XmlAttributes attributes) {
  std::array<double, 3> at{};
  unsigned found = 0;
  for (; *attributes != nullptr; attributes += 2) {
    const char* const name = attributes[0];
    if (name[0] < 'x' || name[0] > 'z' || name[1] != 0) continue;
    const auto axis = static_cast<unsigned>(name[0] - 'x');
    if (!read_decimal(attributes[1], at[axis]))
      return refuse(fmt::format("the coordinate {} is no number; export it again", quoted(attributes[1])));
    found |= 1u << axis;
  }
  if (found != 7) return refuse("a vertex lacks x, y or z; export it again");
  if (current().vertices.size() >= UINT32_MAX) return refuse("an object has more than 2^32 vertices");
  current().vertices.push_back(at);
}

void ModelParser::triangle(XmlAttributes attributes) {
  std::array<std::uint32_t, 3> corners{};
  unsigned found = 0;
  for (; *attributes != nullptr; attributes += 2) {
    const char* const name = attributes[0];
    if (name[0] != 'v' || name[1] < '1' || name[1] > '3' || name[2] != 0) continue;
    const auto corner = static_cast<unsigned>(name[1] - '1');
    if (!read_whole(std::string_view(attributes[1]), corners[corner]) || corners[corner] >= current().vertices.size())
      return refuse(fmt::format("a triangle names vertex {}, of {} (they count from 0); export it again", quoted(attributes[1]),
                                current().vertices.size()));
    found |= 1u << corner;
  }
  if (found != 7) return refuse("a triangle lacks v1, v2 or v3; export it again");
  if (++package_.triangles > triangle_limit_)
    return refuse(fmt::format("holds more triangles than the limit of {}", triangle_limit_));
  current().triangles.push_back(corners);
}

bool ModelParser::read_matrix(std::string_view text, Transform& transform) {
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

void ModelParser::reference(std::string_view what, XmlAttributes attributes, std::vector<ObjectReference>& to) {
  ObjectReference reference{file_, 0, 0, {}, reader_->line()};
  bool has_id = false;
  for (; *attributes != nullptr; attributes += 2) {
    const std::string_view attribute = attributes[0], value = attributes[1];
    if (attribute == "objectid") {
      has_id = read_id(value, reference.id);
    } else if (attribute == "transform") {
      if (!read_matrix(value, reference.transform))
        refuse(fmt::format("the transform {} is not of 12 numbers; export it again", quoted(value)));
    } else if (attribute == "printable") {
      package_.not_printable += trimmed(value) == "0" ? 1 : 0;
    } else if (const XmlName is = attribute_name(attributes[0]); is.space == kProductionNamespace && is.local == "path") {
      reference.file = package_.file_of(part_name(value));
    }
  }
  if (!has_id) refuse(fmt::format("<{}> without an objectid; export it again", what));
  to.push_back(reference);
}

}  // namespace lamina::load
