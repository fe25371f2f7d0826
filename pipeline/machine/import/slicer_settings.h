// pipeline/machine/import/slicer_settings.h: settings of another slicer by key, and which of them were used.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace lamina::pipeline {

/// Texts as their file has them: of several extruders separated by commas, or as a list.
class SlicerSettings {
 public:
  /// Replaces an older value of that key.
  void set(std::string_view key, std::vector<std::string> values) {
    setting_.insert_or_assign(std::string(key), Setting{std::move(values), false});
  }
  void set(std::string_view key, std::string value) { set(key, std::vector<std::string>{std::move(value)}); }
  /// Those of another file; of keys that both have, the other's count.
  void update(const SlicerSettings& other);
  std::size_t size() const { return setting_.size(); }
  bool has(std::string_view key) const { return setting_.contains(key); }

  // --- marks the key as used
  /// The whole value, its elements joined by commas.
  std::optional<std::string> text(std::string_view key);
  /// Element `index`, the first one if there are fewer; without quotes. Nothing for "nil", which is no value.
  std::optional<std::string> element(std::string_view key, std::size_t index = 0);

  /// In alphabetical order.
  std::vector<std::string> unused() const;

 private:
  struct Setting {
    std::vector<std::string> values;
    bool used = false;
  };
  std::map<std::string, Setting, std::less<>> setting_;
};

/// The text without quotes around it.
std::string_view unquoted(std::string_view text);

}  // namespace lamina::pipeline
