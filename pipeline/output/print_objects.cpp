#include "pipeline/output/print_objects.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <string>

namespace lamina::pipeline {
namespace {

std::string plain_name(const std::string& file) {
  constexpr std::size_t kMaxLetters = 40;
  std::string name = file.substr(0, std::min(file.rfind('.'), kMaxLetters));
  for (char& c : name) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
    if (!plain) c = '_';
  }
  return name.empty() ? "part" : name;
}

}  // namespace

std::vector<formats::ExtrusionObject> print_objects(const Sections& sections) {
  std::vector<formats::ExtrusionObject> objects;
  std::set<std::string> used;
  std::map<std::string, std::uint32_t> last;  // number of each base
  for (const std::string& file : sections.names()) {
    const std::string base = plain_name(file);
    std::string name = base;
    std::uint32_t& number = last.try_emplace(base, 1).first->second;
    while (!used.insert(name).second) name = base + "_" + std::to_string(++number);
    objects.push_back({name, {INT64_MAX, INT64_MAX}, {INT64_MIN, INT64_MIN}});
  }
  for (const Sections::Area& area : sections.areas()) {
    formats::ExtrusionObject& object = objects[area.body];
    object.lo[0] = std::min<std::int64_t>(object.lo[0], area.box.lo.x);
    object.lo[1] = std::min<std::int64_t>(object.lo[1], area.box.lo.y);
    object.hi[0] = std::max<std::int64_t>(object.hi[0], area.box.hi.x);
    object.hi[1] = std::max<std::int64_t>(object.hi[1], area.box.hi.y);
  }
  return objects;
}

}  // namespace lamina::pipeline
