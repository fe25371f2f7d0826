#include "stages/read/profiles/changes.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/data/text/number_text.h"

namespace lamina::read {

std::string read_changes(const TomlValue& table, ProfileChanges& changes, Place& at) {
  if (!table.is_table()) return "is a table of keys of the machine's profile, as in fan.from_layer = 2";
  ProfileChanges read;
  for (std::size_t s = 0; s < table.value.size(); ++s) {
    at = table.value[s].place;
    if (!table.value[s].is_table()) return fmt::format("{}: is not section.key, as in fan.from_layer = 2", table.name[s]);
    for (std::size_t i = 0; i < table.value[s].value.size(); ++i) {
      at = table.value[s].value[i].place;
      const std::string name = fmt::format("{}.{}", table.name[s], table.value[s].name[i]);
      const auto text = flat_text(table.value[s].value[i]);
      if (!text) return fmt::format("{}: is not a single value or a list of them", name);
      read.emplace_back(name, *text);
    }
  }
  changes = std::move(read);
  return {};
}

std::string read_changes(std::string_view text, ProfileChanges& changes) {
  if (text.starts_with('{')) {
    Place unused;
    const auto table = read_toml_value(text);
    return table ? read_changes(*table, changes, unused) : "is no table";
  }
  ProfileChanges read;
  for (std::string_view change : split(text, ";")) {
    change = trimmed(change);
    if (change.empty()) continue;
    const std::size_t equals = change.find('='), dot = change.find('.');
    if (equals == std::string_view::npos || dot > equals) return fmt::format("'{}' is not section.key=value", change);
    read.emplace_back(change.substr(0, equals), change.substr(equals + 1));
  }
  std::ranges::stable_sort(read, {}, &ProfileChanges::value_type::first);  // as a table is read: the same job is the same text
  changes = std::move(read);
  return {};
}

std::string changes_text(const ProfileChanges& changes) {
  std::string text;
  for (const auto& [name, value] : changes) text += fmt::format("{}{} = {}", text.empty() ? "" : ", ", name, toml_text(value));
  return text.empty() ? text : fmt::format("{{ {} }}", text);
}

}  // namespace lamina::read
