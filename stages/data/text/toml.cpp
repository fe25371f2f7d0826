#include "stages/data/text/toml.h"
#include "stages/data/text/readable.h"

#include <fmt/format.h>
#define TOML_EXCEPTIONS 0
#define TOML_ENABLE_WINDOWS_COMPAT 0
#include <toml++/toml.h>

#include <algorithm>

#include "stages/data/text/json_text.h"
#include "stages/data/text/number_text.h"

namespace lamina {
namespace {

TomlValue tree_of(const toml::node& node) {
  TomlValue tree;
  tree.place = {static_cast<std::uint32_t>(node.source().begin.line), static_cast<std::uint32_t>(node.source().begin.column)};
  if (const auto* string = node.as_string()) {
    tree.text = string->get();
  } else if (const auto* whole = node.as_integer()) {
    tree.text = fmt::format("{}", whole->get());
  } else if (const auto* number = node.as_floating_point()) {
    tree.text = number_text(number->get());
  } else if (const auto* boolean = node.as_boolean()) {
    tree.text = boolean->get() ? "true" : "false";
  } else if (const auto* list = node.as_array()) {
    tree.kind = TomlValue::Kind::kList;
    for (const toml::node& entry : *list) tree.value.push_back(tree_of(entry));
  } else if (const auto* table = node.as_table()) {
    tree.kind = TomlValue::Kind::kTable;
    for (const auto& [name, entry] : *table) {
      tree.add(name.str(), tree_of(entry));
      Place& place = tree.value.back().place;  // a header's, where the table was opened without one
      if (place.line == 0) {
        place = {static_cast<std::uint32_t>(name.source().begin.line), static_cast<std::uint32_t>(name.source().begin.column)};
      }
    }
  } else {
    tree.kind = TomlValue::Kind::kOther;
  }
  return tree;
}

}  // namespace

std::string Place::text(const std::string& file) const {
  return line == 0 ? std::string() : fmt::format("{}:{}:{}: ", file, line, column);
}

const TomlValue* TomlValue::find(std::string_view wanted) const {
  const auto found = std::ranges::find(name, wanted);
  return found == name.end() ? nullptr : &value[static_cast<std::size_t>(found - name.begin())];
}
TomlValue* TomlValue::find(std::string_view wanted) { return const_cast<TomlValue*>(std::as_const(*this).find(wanted)); }

void TomlValue::add(std::string_view name_of_value, TomlValue added) {
  name.emplace_back(name_of_value);
  value.push_back(std::move(added));
}

void TomlValue::remove(std::string_view name_of_value) {
  const auto at = std::ranges::find(name, name_of_value) - name.begin();
  if (at == std::ssize(name)) return;
  name.erase(name.begin() + at);
  value.erase(value.begin() + at);
}

Result<TomlValue> read_toml(std::string_view text, const std::string& where) {
  const toml::parse_result parsed = toml::parse(text);
  if (parsed) return tree_of(parsed.table());
  const toml::source_position at = parsed.error().source().begin;
  return Error{Fault::kUsage, fmt::format("{}:{}:{}: {}", where, at.line, at.column, one_line(parsed.error().description()))};
}

std::optional<TomlValue> read_toml_value(std::string_view text) {
  auto table = read_toml(fmt::format("value = {}", text), {});
  if (!table || table->value.size() != 1) return std::nullopt;
  return std::move(table->value.front());
}

std::optional<std::string> flat_text(const TomlValue& value) {
  if (value.is_text()) return value.text;
  if (!value.is_list() || !std::ranges::all_of(value.value, &TomlValue::is_text)) return std::nullopt;
  std::string text;
  for (std::size_t i = 0; i < value.value.size(); ++i) text += (i == 0 ? "" : ",") + value.value[i].text;
  return text;
}

std::string toml_string(std::string_view text) { return json_string(text); }  // both escape the same

std::string toml_text(std::string_view text) {
  double number = 0;
  const bool is_number = read_number(text, -1e15, 1e15, "", number).empty() && number_text(number) == text;
  return text == "true" || text == "false" || is_number ? std::string(text) : toml_string(text);
}

}  // namespace lamina
