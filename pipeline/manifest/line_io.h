// pipeline/manifest/line_io.h: writes and reads one line of JSON piece by piece through the same calls.
//
// The reader accepts only the writer's exact spelling, for speed: a hundred thousand lines take a few hundredths of a
// second.
#pragma once

#include <fmt/compile.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>
#include <type_traits>

#include "stages/data/layer.h"
#include "stages/support/hash/hash.h"
#include "stages/support/text/json_text.h"

namespace lamina {

/// Appends the pieces of a line.
class LineWriter {
 public:
  explicit LineWriter(std::string& out) : out_(out) {}
  template <class Number>
  void number(std::string_view key, const Number& value) {
    begin(key);
    char text[32];
    out_.append(text, fmt::format_to(text, FMT_COMPILE("{}"), value));
  }
  /// A text determined by the rest of the line.
  void fixed(std::string_view key, std::string_view value) {
    begin(key);
    out_ += json_string(value);
  }
  void hash(std::string_view key, const Hash128& value) {
    begin(key);
    char text[40];
    out_.append(text, fmt::format_to(text, FMT_COMPILE("\"{:016x}{:016x}\""), value.high, value.low));
  }
  void reason(std::string_view key, const LayerReason& value) { fixed(key, reason_name(value)); }
  /// A list of objects, left out if it is empty. describe(item) writes the numbers of one.
  template <class List, class Describe>
  void list(std::string_view key, const List& items, Describe describe) {
    if (items.empty()) return;
    open(key, "[");
    for (const auto& item : items) {
      open("", "{");
      describe(item);
      close("}");
    }
    close("]");
  }
  /// Opens an object or a list under a key, or as a list element if the key is empty.
  void open(std::string_view key, std::string_view bracket) {
    if (!key.empty()) {
      begin(key);
    } else if (!first_) {
      out_ += ", ";
    }
    out_ += bracket;
    first_ = true;
  }
  void close(std::string_view bracket) {
    out_ += bracket;
    first_ = false;
  }

 private:
  void begin(std::string_view key) {
    if (!first_) out_ += ", ";
    out_ += '"';
    out_ += key;
    out_ += "\": ";
    first_ = false;
  }
  std::string& out_;
  bool first_ = true;
};

/// Consumes the pieces of a line from the front; what() describes its error.
class LineReader {
 public:
  explicit LineReader(std::string_view line) : rest_(line) {}
  template <class Number>
  void number(std::string_view key, Number& value) {
    begin(key);
    const auto [stop, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    expect(error == std::errc());
    if constexpr (std::is_floating_point_v<Number>) expect(std::isfinite(value));
    if (good()) rest_.remove_prefix(static_cast<std::size_t>(stop - rest_.data()));
  }
  void fixed(std::string_view key, std::string_view value) {
    begin(key);
    if (good() && !take(json_string(value))) what_ = fmt::format("its \"{}\" is not {}", key, value);
  }
  void hash(std::string_view key, Hash128& value) {
    begin(key);
    expect(take("\""));
    if (good() && !read_hex(rest_.substr(0, 32), value)) what_ = "has a hash that is none";
    rest_.remove_prefix(std::min<std::size_t>(32, rest_.size()));
    expect(take("\""));
  }
  void reason(std::string_view key, LayerReason& value) {
    begin(key);
    for (const LayerReason one :
         {LayerReason::kUniform, LayerReason::kSlope, LayerReason::kPeak, LayerReason::kCusp, LayerReason::kFlat}) {
      if (!take(fmt::format("\"{}\"", reason_name(one)))) continue;
      value = one;
      return;
    }
    if (good()) what_ = "has a reason that is none";
  }
  template <class List, class Describe>
  void list(std::string_view key, List& items, Describe describe) {
    if (!follows(key)) return;
    open(key, "[");
    while (good() && !rest_.starts_with(']')) {
      open("", "{");
      describe(items.emplace_back());
      close("}");
    }
    close("]");
  }
  void open(std::string_view key, std::string_view bracket) {
    if (!key.empty()) {
      begin(key);
    } else if (!first_) {
      expect(take(", "));
    }
    expect(take(bracket));
    first_ = true;
  }
  void close(std::string_view bracket) {
    expect(take(bracket));
    first_ = false;
  }
  bool good() const { return what_.empty(); }
  const std::string& what() const { return what_; }
  bool ended() const { return rest_.empty(); }

 private:
  void begin(std::string_view key) {
    if (!first_) expect(take(", "));
    expect(take("\"") && take(key) && take("\": "));
    first_ = false;
  }
  /// Whether a number under that key comes next in an object that has begun.
  bool follows(std::string_view key) const {
    return rest_.starts_with(", \"") && rest_.substr(3).starts_with(key) && rest_.substr(3 + key.size()).starts_with("\": ");
  }
  bool take(std::string_view piece) {
    if (!rest_.starts_with(piece)) return false;
    rest_.remove_prefix(piece.size());
    return true;
  }
  void expect(bool holds) {
    if (!holds && what_.empty()) what_ = "is not the line of a layer";
  }
  std::string_view rest_;
  std::string what_;
  bool first_ = true;
};

}  // namespace lamina
