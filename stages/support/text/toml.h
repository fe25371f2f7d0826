// stages/support/text/toml.h: TOML as a tree of texts, each with its place, for the keys of jobs, profiles and printers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina {

/// The start of a value in its file, from 1; 0 without a file.
struct TextPosition {
  std::uint32_t line = 0, column = 0;
  /// "job.toml:12:5: ", or "" without a place.
  std::string text(const std::string& file) const;
};

struct TomlValue {
  enum class Kind : std::uint8_t { kText, kList, kTable, kOther };  // other: dates and times
  Kind kind = Kind::kText;
  std::string text;               // of a string, a number or a switch
  std::vector<std::string> name;  // of the values of a table, in alphabetical order
  std::vector<TomlValue> value;   // of a list or table
  TextPosition position;

  bool is_text() const { return kind == Kind::kText; }
  bool is_list() const { return kind == Kind::kList; }
  bool is_table() const { return kind == Kind::kTable; }
  /// The value with that name in a table, or null.
  const TomlValue* find(std::string_view wanted) const;
  TomlValue* find(std::string_view wanted);
  void add(std::string_view name_of_value, TomlValue added);
  void remove(std::string_view name_of_value);
};

/// Parses a file. errors  kUsage, "where:line:column: what": invalid TOML, or more than 16 levels or parts of a key, or than a
/// million values
Result<TomlValue> read_toml(std::string_view text, const std::string& where);

/// Parses a single value such as [1, 2] or { gap_mm = 0.1 }; nothing for invalid TOML.
std::optional<TomlValue> read_toml_value(std::string_view text);

/// A text, or the texts of a list joined by commas; nothing for other kinds.
std::optional<std::string> flat_text(const TomlValue& value);

/// A basic string in quotes.
std::string toml_string(std::string_view text);

/// A text, bare if it is a number or a switch, otherwise in quotes.
std::string toml_text(std::string_view text);

}  // namespace lamina
