// stages/load/component_scan.h: how much a 3MF model expands to, before a library expands it; internal to load.
#pragma once

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
/// cost  one pass; some bytes an object and component, whatever the size of the meshes
class ComponentScan {
 public:
  /// A file within the package, such as "3D/3dmodel.model"; its bytes follow in pieces.
  void begin_file(std::string_view name);
  void feed(const char* bytes, std::size_t count);

  /// When all files were fed.
  /// errors  kInput: an object that contains itself; components nested more than 1000 deep; more than kMostObjects
  ///         objects, or more triangles than the limit, when all components are expanded
  Status check(const Source& source, std::uint64_t triangle_limit);

  static constexpr std::uint64_t kMostObjects = 1u << 20;
  static constexpr std::uint32_t kDeepest = 1000;

 private:
  struct Object {
    std::uint64_t triangles = 0;
    std::vector<std::string> components;
    std::uint64_t expanded_objects = 0, expanded_triangles = 0;  // 0 objects: not known yet
    std::uint32_t height = 0;
    bool open = false;
  };
  void tag(std::string_view text);
  std::string key(std::string_view path, std::string_view id) const;
  bool expand(Object& object, std::uint32_t depth);

  std::string file_;                       // with a leading slash
  std::string rest_;                       // a tag whose end was not fed yet
  std::map<std::string, Object> objects_;  // by file and id
  Object* current_ = nullptr;              // the object whose tags are read
  std::vector<std::string> items_;
};

}  // namespace lamina::load
