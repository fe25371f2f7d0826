// stages/load/component_scan.h: how much a 3MF model expands to, before a library expands it; internal to load.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"
#include "stages/load/source.h"

namespace lamina::load {

/// Reads no more of the XML than which object contains which, and how many triangles each has. lib3mf follows
/// components path by path while it reads, so that forty objects of two components each keep it busy for days.
/// It errs on the side of refusing: a reference with a path counts as the larger of the objects that it means with the
/// path and without, and what cannot be scanned at all (UTF-16, document types, endless tags) is refused.
/// cost  one pass; some bytes an object and component, whatever the size of the meshes
class ComponentScan {
 public:
  /// Any file within the package, such as "3D/3dmodel.model": relationships may name any of them as a model. Its bytes
  /// follow in pieces. A file that does not begin as XML does is skipped.
  void begin_file(std::string_view name);
  void feed(const char* bytes, std::size_t count);

  /// When all files were fed.
  /// errors  kInput: a model that cannot be scanned; an object that contains itself; components nested more than 1000 deep;
  /// more than kMostObjects
  ///         objects, or more triangles than the limit, when all components are expanded
  Status check(const Source& source, std::uint64_t triangle_limit);

  static constexpr std::uint64_t kMostObjects = 1u << 20;
  static constexpr std::uint32_t kDeepest = 1000;

 private:
  using Id = std::uint64_t;
  struct Reference {
    std::string file, path;  // the one where it stands, and the one where it leads; lower case, with a leading slash
    Id id;
  };
  struct Object {
    std::uint64_t triangles = 0;
    std::vector<Reference> components;
    std::uint64_t expanded_objects = 0, expanded_triangles = 0;  // 0 objects: not known yet
    std::uint32_t height = 0;
    bool open = false;
  };
  enum class Place { kStart, kSkip, kText, kOpen, kTag, kQuote, kRemark, kData, kInstruction };

  void feed_start(char next);
  void feed_open(char next);
  std::size_t feed_tag(std::string_view text, std::size_t at);
  std::size_t feed_quote(std::string_view text, std::size_t at);
  std::size_t skip_past(std::string_view mark, std::string_view text, std::size_t at);
  void tag(std::string_view text);
  void refuse(std::string_view why);
  std::array<Object*, 2> find(const Reference& reference);
  bool expand(Object& object, std::uint32_t depth);

  std::string file_;  // being fed; lower case, with a leading slash
  Place place_ = Place::kStart;
  std::string tag_;  // what was fed of the tag, or of the end of a remark, that is not whole yet
  char quote_ = 0;
  std::string refused_;  // why, if a file cannot be scanned

  std::map<Id, std::map<std::string, Object>> objects_;  // by id, then by file
  Object* current_ = nullptr;                            // the object whose tags are read
  std::vector<Reference> items_;
};

}  // namespace lamina::load
