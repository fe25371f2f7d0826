#include "pipeline/machine/import/slicer_settings.h"

#include <algorithm>
#include <utility>

#include "stages/support/text/number_text.h"

namespace lamina::pipeline {

namespace {

/// The elements of a list: numbers are separated by commas, texts by semicolons and quoted where they contain one
/// (PrusaSlicer, Config.cpp, unescape_strings_cstyle).
std::vector<std::string_view> elements_of(std::string_view list) {
  std::vector<std::string_view> elements;
  std::size_t begin = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (list[i] == '\\' && quoted) {
      ++i;
    } else if (list[i] == '"') {
      quoted = !quoted;
    } else if (!quoted && (list[i] == ',' || list[i] == ';')) {
      elements.push_back(list.substr(begin, i - begin));
      begin = i + 1;
    }
  }
  elements.push_back(list.substr(begin));
  return elements;
}

}  // namespace

void SlicerSettings::update(const SlicerSettings& other) {
  for (const auto& [key, setting] : other.setting_) setting_.insert_or_assign(key, setting);
}

std::optional<std::string> SlicerSettings::text(std::string_view key) {
  const auto found = setting_.find(key);
  if (found == setting_.end()) return std::nullopt;
  found->second.used = true;
  std::string text;
  for (const std::string& value : found->second.values) text += (text.empty() ? "" : ",") + value;
  return text;
}

std::optional<std::string> SlicerSettings::element(std::string_view key, std::size_t index) {
  const auto found = setting_.find(key);
  if (found == setting_.end() || found->second.values.empty()) return std::nullopt;
  found->second.used = true;
  const std::vector<std::string>& values = found->second.values;
  const auto elements =
      values.size() > 1 ? std::vector<std::string_view>(values.begin(), values.end()) : elements_of(values[0]);
  const std::string_view chosen = unquoted(trimmed(elements[index < elements.size() ? index : 0]));
  if (chosen == "nil" || chosen.empty()) return std::nullopt;
  return std::string(chosen);
}

std::vector<std::string> SlicerSettings::unused() const {
  std::vector<std::string> keys;
  for (const auto& [key, setting] : setting_) {
    if (!setting.used) keys.push_back(key);
  }
  return keys;
}

std::string_view unquoted(std::string_view text) {
  return text.size() >= 2 && text.front() == '"' && text.back() == '"' ? text.substr(1, text.size() - 2) : text;
}

}  // namespace lamina::pipeline
