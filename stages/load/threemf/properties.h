// stages/load/threemf/properties.h: whether colours, textures and materials are as the specification wants them; internal to
// load.
#pragma once

#include <cstdint>
#include <map>
#include <string_view>
#include <vector>

#include "stages/data/status.h"
#include "stages/load/threemf/xml.h"

namespace lamina::load {

/// lamina prints none of them, but a file in which they contradict themselves is not what its program meant. Checked are the
/// attributes that have to be there, and what groups of properties refer to; not the values.
///
/// source  3MF Consortium, Core Specification 1.3, chapters 4 and 5; Materials and Properties Extension 1.2, chapters 2 to 6
class Properties {
 public:
  static constexpr std::uint64_t kNoId = UINT64_MAX;
  /// An element of a namespace of 3MF: a resource, or what stands in one.
  /// id  of the resource, or kNoId
  /// errors  kInput, without a file or line: the first thing that it lacks
  Status add(std::string_view element, XmlAttributes attributes, std::uint64_t id, std::uint64_t line);

  /// Once all of a file are known. errors  as add(): what refers to the wrong kind of resource
  /// line  receives its line
  Status check_references(std::uint64_t& line) const;

 private:
  enum class GroupKind { kNone, kMaterials, kComposites, kColors, kTexture, kTextureGroup, kMulti };
  struct Reference {
    GroupKind from;
    std::vector<std::uint64_t> to;
    std::uint64_t line;
  };
  static GroupKind kind_of(std::string_view element);
  GroupKind kind_of(std::uint64_t id) const;
  Status check(const Reference& reference) const;

  std::map<std::uint64_t, GroupKind> kinds_;  // of resources by their ids
  std::vector<Reference> references_;
};

}  // namespace lamina::load
