// pipeline/text/toml_values.h: the values of a profile in TOML as the texts that its keys read.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// section.name = text, in the order of the names.
struct TomlValue {
  enum class Kind : std::uint8_t {
    kValue,
    kNoValue,    // a table, a date, a list too deep
    kNoSection,  // stands outside of any section; `section` is its name
    kSection     // a section begins
  };
  Kind kind = Kind::kValue;
  std::string section, name, text;
  std::uint32_t line = 0;
};

/// How lists become text. kFlat: values with commas between them. kRows: lists of lists too, with ; between the rows, and
/// a line for each text.
enum class TomlLists : std::uint8_t { kFlat, kRows };

/// All values of a file of sections. errors  kUsage: what is no TOML, "where:line:column: what"
Result<std::vector<TomlValue>> read_toml_values(std::string_view text, const std::string& where, TomlLists lists);

}  // namespace lamina::pipeline
