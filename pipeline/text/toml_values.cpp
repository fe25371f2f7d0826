#include "pipeline/text/toml_values.h"

#include <fmt/format.h>
#define TOML_EXCEPTIONS 0
#define TOML_ENABLE_WINDOWS_COMPAT 0
#include <toml++/toml.h>

#include "pipeline/text/json_text.h"
#include "pipeline/text/number_text.h"

namespace lamina::pipeline {
namespace {

/// Appends a value; false if it is none.
bool add_text(const toml::node& node, TomlLists lists, int depth, std::string& text) {
  if (const auto* string = node.as_string()) {
    text += string->get();
  } else if (const auto* whole = node.as_integer()) {
    text += fmt::format("{}", whole->get());
  } else if (const auto* number = node.as_floating_point()) {
    text += number_text(number->get());
  } else if (const auto* boolean = node.as_boolean()) {
    text += boolean->get() ? "true" : "false";
  } else if (const auto* list = node.as_array(); list != nullptr && depth < (lists == TomlLists::kRows ? 2 : 1)) {
    for (std::size_t i = 0; i < list->size(); ++i) {
      const toml::node& entry = (*list)[i];
      if (i > 0) text += lists == TomlLists::kFlat ? ',' : entry.is_array() ? ';' : entry.is_string() ? '\n' : ',';
      if (!add_text(entry, lists, depth + 1, text)) return false;
    }
  } else {
    return false;
  }
  return true;
}

}  // namespace

Result<std::vector<TomlValue>> read_toml_values(std::string_view text, const std::string& where, TomlLists lists) {
  const toml::parse_result parsed = toml::parse(text, where);
  if (!parsed) {
    const toml::source_position at = parsed.error().source().begin;
    return Error{Fault::kUsage, fmt::format("{}:{}:{}: {}", where, at.line, at.column, one_line(parsed.error().description()))};
  }
  std::vector<TomlValue> values;
  const auto add = [&](TomlValue::Kind kind, std::string_view section, std::string_view name, const toml::node& node) {
    values.push_back({kind, std::string(section), std::string(name), {}, static_cast<std::uint32_t>(node.source().begin.line)});
  };
  for (const auto& [section, node] : parsed.table()) {
    const toml::table* table = node.as_table();
    add(table == nullptr ? TomlValue::Kind::kNoSection : TomlValue::Kind::kSection, section.str(), {}, node);
    if (table == nullptr) continue;
    for (const auto& [name, value] : *table) {
      add(TomlValue::Kind::kValue, section.str(), name.str(), value);
      if (!add_text(value, lists, 0, values.back().text)) values.back().kind = TomlValue::Kind::kNoValue;
    }
  }
  return values;
}

}  // namespace lamina::pipeline
