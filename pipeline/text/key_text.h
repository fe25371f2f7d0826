// pipeline/text/key_text.h: how the values of job keys are read and written; shared by the files that list keys.
#pragma once

#include <fmt/format.h>

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/text/names.h"
#include "pipeline/text/number_text.h"

namespace lamina::pipeline {

inline constexpr double kLeastMm = 1e-6;  // 1 nm
inline constexpr double kMostMm = 2147;   // what 32 bits of nanometres hold, in whole mm

/// A word of a fixed list and the value it stands for.
template <class Value>
struct Word {
  std::string_view word;
  Value value;
};

inline std::string not_one_of(std::string_view text, std::span<const std::string_view> words) {
  return fmt::format("'{}' is none of {}{}", text, fmt::join(words, ", "), suggest(text, words));
}

template <class Value, std::size_t N>
std::string read_word(const Word<Value> (&words)[N], std::string_view text, Value& value) {
  std::vector<std::string_view> names;
  for (const auto& [word, meaning] : words) {
    if (word == text) {
      value = meaning;
      return {};
    }
    names.push_back(word);
  }
  return not_one_of(text, names);
}

template <class Value, std::size_t N>
std::string write_word(const Word<Value> (&words)[N], Value value) {
  for (const auto& [word, meaning] : words) {
    if (meaning == value) return std::string(word);
  }
  return {};
}

inline std::string write_switch(bool value) { return value ? "true" : "false"; }

template <std::size_t N>
std::string write_list(const std::array<double, N>& values) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(number_text(value));
  return fmt::format("{}", fmt::join(texts, ","));
}

inline std::string read_path(std::string_view text, std::string& path) {
  if (text.empty()) return "is empty; name a file or directory";
  if (text.find('\0') != std::string_view::npos) return "holds a zero byte; name a file or directory";
  path = text;
  return {};
}

}  // namespace lamina::pipeline
