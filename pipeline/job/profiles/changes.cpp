#include "pipeline/job/profiles/changes.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/support/text/number_text.h"

namespace lamina::read {
namespace {

/// Whether a name is section.key, spelt as keys of profiles are: others could not be written and read again.
bool is_name(std::string_view name) {
  const std::size_t dot = name.find('.');
  const auto is_bare = [](std::string_view key) {
    return !key.empty() && std::ranges::all_of(key, [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    });
  };
  return dot != std::string_view::npos && is_bare(name.substr(0, dot)) && is_bare(name.substr(dot + 1));
}

}  // namespace

std::string read_changes(const TomlValue& table, ProfileChanges& changes, Place& at) {
  if (!table.is_table()) return "is a table of keys of the machine's profile, as in fan.from_layer = 2";
  ProfileChanges read;
  for (std::size_t s = 0; s < table.value.size(); ++s) {
    at = table.value[s].place;
    if (!table.value[s].is_table()) return fmt::format("{}: is not section.key, as in fan.from_layer = 2", table.name[s]);
    for (std::size_t i = 0; i < table.value[s].value.size(); ++i) {
      at = table.value[s].value[i].place;
      const std::string name = fmt::format("{}.{}", table.name[s], table.value[s].name[i]);
      if (!is_name(name)) return fmt::format("'{}' is not section.key, as in fan.from_layer", name);
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
    const std::size_t equals = change.find('=');
    const std::string_view name = trimmed(change.substr(0, equals));
    if (equals == std::string_view::npos || !is_name(name)) return fmt::format("'{}' is not section.key=value", change);
    read.emplace_back(name, change.substr(equals + 1));
  }
  std::ranges::stable_sort(read, {}, &ProfileChanges::value_type::first);  // as a table is read: the same job is the same text
  const auto twice = std::ranges::adjacent_find(read, {}, &ProfileChanges::value_type::first);
  if (twice != read.end()) return fmt::format("{} is set twice", twice->first);
  changes = std::move(read);
  return {};
}

std::string changes_text(const ProfileChanges& changes) {
  std::string text;
  for (const auto& [name, value] : changes) text += fmt::format("{}{} = {}", text.empty() ? "" : ", ", name, toml_text(value));
  return text.empty() ? text : fmt::format("{{ {} }}", text);
}

}  // namespace lamina::read
