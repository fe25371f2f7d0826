// stages/text/toml.h: TOML as a tree of texts, each with its place, for the keys of jobs, profiles and printers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina {

/// Where a value begins in its file, from 1; 0 if it came from no file.
struct Place {
  std::uint32_t line = 0, column = 0;
  /// "job.toml:12:5: ", or "" if there is none.
  std::string text(const std::string& file) const;
};

struct TomlValue {
  enum class Kind : std::uint8_t { kText, kList, kTable, kOther };  // other: dates and times
  Kind kind = Kind::kText;
  std::string text;               // of a string, a number or a switch
  std::vector<std::string> name;  // of the values of a table, in alphabetical order
  std::vector<TomlValue> value;   // of a list or table
  Place place;

  bool is_text() const { return kind == Kind::kText; }
  bool is_list() const { return kind == Kind::kList; }
  bool is_table() const { return kind == Kind::kTable; }
  /// The value of that name in a table, or null.
  const TomlValue* find(std::string_view wanted) const;
  TomlValue* find(std::string_view wanted);
  void add(std::string_view name_of_value, TomlValue added);
  void remove(std::string_view name_of_value);
};

/// A file. errors  kUsage: what is no TOML, "where:line:column: what"
Result<TomlValue> read_toml(std::string_view text, const std::string& where);

/// A value on its own, as in [1, 2] or { gap_mm = 0.1 }; none if it is no TOML.
std::optional<TomlValue> read_toml_value(std::string_view text);

/// A text, or the texts of a list with commas between; none of anything else.
std::optional<std::string> flat_text(const TomlValue& value);

/// A basic string in quotes.
std::string toml_string(std::string_view text);

/// A text as the number or switch that it is, or in quotes.
std::string toml_text(std::string_view text);

}  // namespace lamina
