// stages/load/component_scan.cpp: a reader of tags, not of XML: what it does not understand it leaves to lib3mf.
#include "stages/load/component_scan.h"

#include <fmt/core.h>

#include <algorithm>

namespace lamina::load {
namespace {

constexpr std::uint64_t kTooMany = std::uint64_t{1} << 62;
constexpr std::size_t kLongestTag = std::size_t{1} << 20;

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

/// The name of a tag without its namespace prefix.
std::string_view name_of(std::string_view text) {
  std::size_t end = 0;
  while (end < text.size() && !is_blank(text[end]) && text[end] != '/') ++end;
  const std::string_view name = text.substr(0, end);
  return name.substr(name.find(':') == name.npos ? 0 : name.find(':') + 1);
}

/// The value of an attribute, whatever its prefix; empty if there is none.
std::string_view attribute(std::string_view text, std::string_view name) {
  for (std::size_t at = text.find(name); at != text.npos; at = text.find(name, at + 1)) {
    if (at == 0 || (!is_blank(text[at - 1]) && text[at - 1] != ':')) continue;
    std::size_t value = at + name.size();
    while (value < text.size() && is_blank(text[value])) ++value;
    if (value >= text.size() || text[value] != '=') continue;
    ++value;
    while (value < text.size() && is_blank(text[value])) ++value;
    if (value >= text.size() || (text[value] != '"' && text[value] != '\'')) continue;
    const std::size_t end = text.find(text[value], value + 1);
    return end == text.npos ? std::string_view() : text.substr(value + 1, end - value - 1);
  }
  return {};
}

}  // namespace

void ComponentScan::begin_file(std::string_view name) {
  file_ = std::string(name.substr(0, 1) == "/" ? "" : "/") + std::string(name);
  rest_.clear();
  current_ = nullptr;
}

std::string ComponentScan::key(std::string_view path, std::string_view id) const {
  return (path.empty() ? file_ : std::string(path)) + "#" + std::string(id);
}

void ComponentScan::feed(const char* bytes, std::size_t count) {
  std::string_view text(bytes, count);
  if (!rest_.empty()) {
    rest_.append(bytes, count);
    text = rest_;
  }
  std::size_t at = 0;
  while ((at = text.find('<', at)) != text.npos) {
    const bool remark = text.substr(at, 4) == "<!--";
    const std::size_t end = remark ? text.find("-->", at) : text.find('>', at);
    if (end == text.npos) break;
    if (!remark) tag(text.substr(at + 1, end - at - 1));
    at = end + 1;
  }
  std::string rest(at == text.npos || text.size() - at > kLongestTag ? std::string_view() : text.substr(at));
  rest_ = std::move(rest);
}

void ComponentScan::tag(std::string_view text) {
  const std::string_view name = name_of(text);
  if (name == "triangle") {
    if (current_ != nullptr) ++current_->triangles;
  } else if (name == "object") {
    current_ = &objects_[key({}, attribute(text, "id"))];
  } else if (name == "component") {
    if (current_ != nullptr) current_->components.push_back(key(attribute(text, "path"), attribute(text, "objectid")));
  } else if (name == "item") {
    items_.push_back(key(attribute(text, "path"), attribute(text, "objectid")));
  }
}

bool ComponentScan::expand(Object& object, std::uint32_t depth) {
  if (object.expanded_objects > 0) return true;
  if (object.open || depth > kDeepest) return false;
  object.open = true;
  std::uint64_t objects = 1, triangles = object.triangles;
  for (const std::string& component : object.components) {
    const auto found = objects_.find(component);
    if (found == objects_.end()) continue;  // lib3mf says what is wrong with it
    if (!expand(found->second, depth + 1)) return false;
    objects = std::min(objects + found->second.expanded_objects, kTooMany);
    triangles = std::min(triangles + found->second.expanded_triangles, kTooMany);
    object.height = std::max(object.height, found->second.height + 1);
  }
  object.open = false;
  object.expanded_objects = objects;
  object.expanded_triangles = triangles;
  return object.height <= kDeepest;
}

Status ComponentScan::check(const Source& source, std::uint64_t triangle_limit) {
  std::uint64_t objects = 0, triangles = 0;
  for (auto& [name, object] : objects_) {
    if (!expand(object, 0))
      return source.error(fmt::format(
          "an object contains itself, or components are nested more than {} deep; export it again", kDeepest));
    objects = std::max(objects, object.expanded_objects);
  }
  for (const std::string& item : items_) {
    const auto found = objects_.find(item);
    if (found == objects_.end()) continue;
    objects = std::min(objects + found->second.expanded_objects, kTooMany);
    triangles = std::min(triangles + found->second.expanded_triangles, kTooMany);
  }
  if (triangles > triangle_limit)
    return source.error(fmt::format("its components expand to more triangles than the limit of {}", triangle_limit));
  if (objects > kMostObjects)
    return source.error(fmt::format("its components expand to more than {} objects; export them as one", kMostObjects));
  return {};
}

}  // namespace lamina::load
