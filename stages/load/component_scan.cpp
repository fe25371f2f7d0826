// stages/load/component_scan.cpp: a reader of tags, not of XML: what it does not understand it leaves to lib3mf.
#include "stages/load/component_scan.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <utility>

namespace lamina::load {
namespace {

constexpr std::uint64_t kTooMany = std::uint64_t{1} << 62;
constexpr std::size_t kLongestTag = std::size_t{1} << 20;

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

std::string_view without_prefix(std::string_view name) {
  const std::size_t colon = name.find(':');
  return colon == name.npos ? name : name.substr(colon + 1);
}

/// Takes a name from the front of a tag's text.
std::string_view take_name(std::string_view& text) {
  std::size_t end = 0;
  while (end < text.size() && !is_blank(text[end]) && text[end] != '/' && text[end] != '=') ++end;
  const std::string_view name = text.substr(0, end);
  text.remove_prefix(end);
  return without_prefix(name);
}

void skip_blanks(std::string_view& text) {
  while (!text.empty() && (is_blank(text.front()) || text.front() == '/')) text.remove_prefix(1);
}

/// Character references become the characters that they stand for; those that are no ASCII do not matter here.
std::string plain_text(std::string_view value) {
  constexpr std::pair<std::string_view, char> kNamed[] = {
      {"amp", '&'}, {"lt", '<'}, {"gt", '>'}, {"quot", '"'}, {"apos", '\''}};
  std::string plain;
  for (std::size_t at = 0; at < value.size(); ++at) {
    const std::size_t end = value[at] == '&' ? value.find(';', at) : value.npos;
    if (end == value.npos) {
      plain += value[at];
      continue;
    }
    std::string_view reference = value.substr(at + 1, end - at - 1);
    if (reference.starts_with('#')) {
      reference.remove_prefix(1);
      const bool hexadecimal = reference.starts_with('x');
      reference.remove_prefix(hexadecimal ? 1 : 0);
      std::uint32_t code = 0;
      std::from_chars(reference.data(), reference.data() + reference.size(), code, hexadecimal ? 16 : 10);
      plain += code < 128 ? static_cast<char>(code) : '?';
    }
    for (const auto& [name, character] : kNamed) {
      if (reference == name) plain += character;
    }
    at = end;
  }
  return plain;
}

/// The names of files in a package have no case, and paths to them begin with a slash.
std::string file_name(std::string_view text) {
  std::string name = text.starts_with('/') ? std::string() : std::string("/");
  for (const char c : text) name += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return name;
}

/// Ids are whole numbers; 007 is 7.
std::uint64_t id_of(std::string_view text) {
  while (!text.empty() && (is_blank(text.front()) || text.front() == '+')) text.remove_prefix(1);
  std::uint64_t id = 0;
  std::from_chars(text.data(), text.data() + text.size(), id);
  return id;
}

/// What a tag says of an object: its own id, or the one that it refers to.
struct Attributes {
  std::uint64_t id = 0, object_id = 0;
  std::string path;
};

Attributes read_attributes(std::string_view text) {
  Attributes read;
  for (skip_blanks(text); !text.empty(); skip_blanks(text)) {
    const std::string_view name = take_name(text);
    skip_blanks(text);
    if (!text.starts_with('=')) {
      if (name.empty() && !text.empty()) text.remove_prefix(1);
      continue;
    }
    text.remove_prefix(1);
    skip_blanks(text);
    if (text.empty() || (text.front() != '"' && text.front() != '\'')) continue;
    const std::size_t end = text.find(text.front(), 1);
    const std::string_view value = text.substr(1, end == text.npos ? text.npos : end - 1);
    text.remove_prefix(end == text.npos ? text.size() : end + 1);
    if (name == "id") read.id = id_of(plain_text(value));
    if (name == "objectid") read.object_id = id_of(plain_text(value));
    if (name == "path") read.path = file_name(plain_text(value));
  }
  return read;
}

}  // namespace

void ComponentScan::begin_file(std::string_view name) {
  file_ = file_name(name);
  place_ = Place::kStart;
  tag_.clear();
  current_ = nullptr;
}

void ComponentScan::refuse(std::string_view why) {
  if (refused_.empty()) refused_ = fmt::format("{} {}", file_.substr(1), why);
  place_ = Place::kSkip;
}

// A file that does not begin as XML does is skipped.
void ComponentScan::feed_start(char next) {
  tag_ += next;
  const auto may_become = [&](std::string_view whole) { return whole.starts_with(tag_); };
  constexpr std::string_view kMark = "\xEF\xBB\xBF", kBig = "\xFE\xFF", kLittle = "\xFF\xFE";
  constexpr std::string_view kBigTag("\0<", 2), kLittleTag("<\0", 2);
  if (tag_ == kBig || tag_ == kLittle || tag_ == kBigTag || tag_ == kLittleTag) {
    refuse("is UTF-16; save it as UTF-8");
  } else if (tag_ == kMark || is_blank(tag_.front())) {
    tag_.clear();
  } else if (tag_.front() == '<' && tag_.size() == 2) {
    tag_.clear();
    place_ = Place::kOpen;
    feed_open(next);
  } else if (!may_become(kMark) && !may_become(kBig) && !may_become(kLittle) && !may_become("<") && !may_become(kBigTag)) {
    place_ = Place::kSkip;
  }
}

// What stands behind '<' tells what it opens.
void ComponentScan::feed_open(char next) {
  tag_ += next;
  const auto may_become = [&](std::string_view whole) { return whole.starts_with(tag_); };
  if (tag_ == "!--" || tag_ == "![CDATA[" || tag_ == "?") {
    place_ = tag_ == "?" ? Place::kInstruction : tag_ == "!--" ? Place::kRemark : Place::kData;
    tag_.clear();
  } else if (tag_ == "!D") {
    refuse("has a document type, which 3MF forbids; export it again");
  } else if (!may_become("!--") && !may_become("![CDATA[") && !may_become("!D")) {
    place_ = Place::kTag;
    tag_.pop_back();
    feed_tag({&next, 1}, 0);
  }
}

// Both take the longest piece of text that needs no decision, and return where it ends.
std::size_t ComponentScan::feed_tag(std::string_view text, std::size_t at) {
  const std::size_t end = std::min(text.find_first_of(">\"'", at), text.size());
  tag_.append(text, at, end - at);
  if (end == text.size()) return end;
  if (text[end] == '>') {
    tag(tag_);
    tag_.clear();
    place_ = Place::kText;
  } else {
    quote_ = text[end];
    tag_ += quote_;
    place_ = Place::kQuote;
  }
  return end + 1;
}

std::size_t ComponentScan::feed_quote(std::string_view text, std::size_t at) {
  const std::size_t end = std::min(text.find(quote_, at), text.size());
  tag_.append(text, at, end - at);
  if (end == text.size()) return end;
  tag_ += quote_;
  place_ = Place::kTag;
  return end + 1;
}

// Skips to the end mark, which may have begun in the piece before.
std::size_t ComponentScan::skip_past(std::string_view mark, std::string_view text, std::size_t at) {
  for (; at < text.size(); ++at) {
    tag_ += text[at];
    if (tag_.size() > mark.size()) tag_.erase(0, 1);
    if (tag_ != mark) continue;
    tag_.clear();
    place_ = Place::kText;
    return at + 1;
  }
  return at;
}

void ComponentScan::feed(const char* bytes, std::size_t count) {
  const std::string_view text(bytes, count);
  for (std::size_t at = 0; at < text.size() && place_ != Place::kSkip;) {
    switch (place_) {
      case Place::kStart: feed_start(text[at++]); break;
      case Place::kText:
        at = std::min(text.find('<', at), text.size());
        if (at < text.size()) {
          ++at;
          place_ = Place::kOpen;
        }
        break;
      case Place::kOpen: feed_open(text[at++]); break;
      case Place::kTag: at = feed_tag(text, at); break;
      case Place::kQuote: at = feed_quote(text, at); break;
      case Place::kRemark: at = skip_past("-->", text, at); break;
      case Place::kData: at = skip_past("]]>", text, at); break;
      case Place::kInstruction: at = skip_past("?>", text, at); break;
      case Place::kSkip: break;
    }
    if (tag_.size() > kLongestTag) refuse(fmt::format("has a tag of more than {} bytes; export it again", kLongestTag));
  }
}

void ComponentScan::tag(std::string_view text) {
  const std::string_view name = take_name(text);
  if (name == "triangle") {
    if (current_ != nullptr) ++current_->triangles;
    return;
  }
  if (name != "object" && name != "component" && name != "item") return;
  Attributes is = read_attributes(text);
  if (name == "object") {
    current_ = &objects_[is.id][file_];
    return;
  }
  Reference reference{file_, is.path.empty() ? file_ : std::move(is.path), is.object_id};
  if (name == "item") {
    items_.push_back(std::move(reference));
  } else if (current_ != nullptr) {
    current_->components.push_back(std::move(reference));
  }
}

/// Null where there is none: lib3mf says what is wrong with it, or does not look at the path at all.
std::array<ComponentScan::Object*, 2> ComponentScan::find(const Reference& reference) {
  const auto object_in = [&](const std::string& file) -> Object* {
    const auto same_id = objects_.find(reference.id);
    if (same_id == objects_.end()) return nullptr;
    const auto there = same_id->second.find(file);
    return there == same_id->second.end() ? nullptr : &there->second;
  };
  return {object_in(reference.path), reference.path == reference.file ? nullptr : object_in(reference.file)};
}

bool ComponentScan::expand(Object& object, std::uint32_t depth) {
  if (object.expanded_objects > 0) return true;
  if (object.open || depth > kDeepest) return false;
  object.open = true;
  std::uint64_t objects = 1, triangles = object.triangles;
  for (const Reference& component : object.components) {
    std::uint64_t more_objects = 0, more_triangles = 0;
    const auto [by_path, by_id] = find(component);
    for (Object* const found : {by_path, by_id}) {
      if (found == nullptr || (found == &object && by_path != nullptr && found == by_id)) continue;
      if (!expand(*found, depth + 1)) return false;
      more_objects = std::max(more_objects, found->expanded_objects);
      more_triangles = std::max(more_triangles, found->expanded_triangles);
      object.height = std::max(object.height, found->height + 1);
    }
    objects = std::min(objects + more_objects, kTooMany);
    triangles = std::min(triangles + more_triangles, kTooMany);
  }
  object.open = false;
  object.expanded_objects = objects;
  object.expanded_triangles = triangles;
  return object.height <= kDeepest;
}

Status ComponentScan::check(const Source& source, std::uint64_t triangle_limit) {
  if (!refused_.empty()) return source.error(refused_);
  std::uint64_t objects = 0, triangles = 0;
  for (auto& [id, same_id] : objects_) {
    for (auto& [file, object] : same_id) {
      if (!expand(object, 0))
        return source.error(
            fmt::format("an object contains itself, or components are nested more than {} deep; export it again", kDeepest));
      objects = std::max(objects, object.expanded_objects);
    }
  }
  for (const Reference& item : items_) {
    std::uint64_t more_objects = 0, more_triangles = 0;
    for (const Object* const found : find(item)) {
      if (found == nullptr) continue;
      more_objects = std::max(more_objects, found->expanded_objects);
      more_triangles = std::max(more_triangles, found->expanded_triangles);
    }
    objects = std::min(objects + more_objects, kTooMany);
    triangles = std::min(triangles + more_triangles, kTooMany);
  }
  if (triangles > triangle_limit)
    return source.error(fmt::format("its components expand to more triangles than the limit of {}", triangle_limit));
  if (objects > kMostObjects)
    return source.error(fmt::format("its components expand to more than {} objects; export them as one", kMostObjects));
  return {};
}

}  // namespace lamina::load
