#include "stages/load/threemf/properties.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cstring>

namespace lamina::load {
namespace {

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

const char* find_attribute(XmlAttributes attributes, std::string_view name) {
  for (; *attributes != nullptr; attributes += 2) {
    if (attributes[0] == name) return attributes[1];
  }
  return nullptr;
}

Error wrong(std::string what) { return {Fault::kInput, std::move(what) + "; export it again"}; }

/// What is no number leads to nothing.
std::vector<std::uint64_t> read_ids(std::string_view text) {
  std::vector<std::uint64_t> ids;
  for (std::size_t at = 0; (at = text.find_first_not_of(" \t\r\n", at)) != text.npos;) {
    const std::string_view word = text.substr(at, text.find_first_of(" \t\r\n", at) - at);
    std::uint64_t& id = ids.emplace_back(Properties::kNoId);
    std::from_chars(word.data(), word.data() + word.size(), id);
    at += word.size();
  }
  return ids;
}

}  // namespace

Properties::GroupKind Properties::kind_of(std::string_view element) {
  if (element == "basematerials") return GroupKind::kMaterials;
  if (element == "compositematerials") return GroupKind::kComposites;
  if (element == "colorgroup") return GroupKind::kColors;
  if (element == "texture2d") return GroupKind::kTexture;
  if (element == "texture2dgroup") return GroupKind::kTextureGroup;
  return element == "multiproperties" ? GroupKind::kMulti : GroupKind::kNone;
}

Properties::GroupKind Properties::kind_of(std::uint64_t id) const {
  const auto found = kinds_.find(id);
  return found == kinds_.end() ? GroupKind::kNone : found->second;
}

Status Properties::add(std::string_view element, XmlAttributes attributes, std::uint64_t id, std::uint64_t line) {
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

Status Properties::check(const Reference& reference) const {
  const auto count = [&](GroupKind kind) {
    return std::count_if(reference.to.begin(), reference.to.end(), [&](std::uint64_t id) { return kind_of(id) == kind; });
  };
  switch (reference.from) {
    case GroupKind::kTextureGroup:
      if (count(GroupKind::kTexture) != 1) return wrong("<texture2dgroup>: its texid leads to no <texture2d> (materials 3)");
      return {};
    case GroupKind::kComposites:
      if (count(GroupKind::kMaterials) != 1)
        return wrong("<compositematerials>: its matid leads to no <basematerials> (materials 4)");
      return {};
    case GroupKind::kMulti:
      if (reference.to.empty()) return wrong("<multiproperties>: its pids are empty (materials 5)");
      if (count(GroupKind::kMulti) > 0)
        return wrong("<multiproperties> refers to <multiproperties>, which 3MF forbids (materials 5)");
      if (count(GroupKind::kMaterials) + count(GroupKind::kComposites) > 1)
        return wrong("<multiproperties> refers to more than one group of materials, which 3MF forbids (materials 5)");
      if (count(GroupKind::kColors) > 1)
        return wrong("<multiproperties> refers to more than one <colorgroup>, which 3MF forbids (materials 5)");
      return {};
    default: return {};
  }
}

Status Properties::check_references(std::uint64_t& line) const {
  for (const Reference& reference : references_) {
    line = reference.line;
    if (Status status = check(reference); !status) return status;
  }
  return {};
}

}  // namespace lamina::load
