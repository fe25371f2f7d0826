// stages/support/text/value.h: reads, checks and writes values of each type within their limits.
//
// Readers and checks return an empty string, or an error with the valid form, to follow the value's name.
#pragma once

#include <fmt/format.h>

#include <array>
#include <concepts>
#include <cstdint>
#include <optional>
#include <ranges>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/support/text/number_text.h"

namespace lamina {

inline constexpr double kMinMm = 1e-6;  // 1 nm
inline constexpr double kMaxMm = 2147;  // the range of 32-bit nanometres, in whole mm

/// The limits of a number, and of the length of a list.
struct Limits {
  double low = 0, high = 0;
  std::string_view unit = {};  // for messages, as in " mm"
  bool one_for_all = false;    // one number may stand for a list of fixed length
  std::size_t minimum = 0, maximum = 100'000;
  std::uint32_t digits = 0;  // most digits after the point; 0: any number
};

// --- one value
std::string read_value(std::string_view text, const Limits& limits, double& value);
std::string read_value(std::string_view text, const Limits& limits, bool& value);
template <std::integral Whole>
std::string read_value(std::string_view text, const Limits& limits, Whole& value) {
  std::int64_t whole = 0;
  auto wrong = read_whole(text, static_cast<std::int64_t>(limits.low), static_cast<std::int64_t>(limits.high), whole);
  if (wrong.empty()) value = static_cast<Whole>(whole);
  return wrong;
}

std::string check_value(double value, const Limits& limits);
std::string check_value(std::int64_t value, const Limits& limits);
inline std::string check_value(std::uint32_t value, const Limits& limits) { return check_value(std::int64_t{value}, limits); }
inline std::string check_value(std::int32_t value, const Limits& limits) { return check_value(std::int64_t{value}, limits); }
inline std::string check_value(bool, const Limits&) { return {}; }

inline std::string value_text(double value) { return number_text(value); }
inline std::string value_text(std::int64_t value) { return fmt::format("{}", value); }
inline std::string value_text(std::uint32_t value) { return fmt::format("{}", value); }
inline std::string value_text(std::int32_t value) { return fmt::format("{}", value); }
inline std::string value_text(bool value) { return value ? "true" : "false"; }

// --- lists, with commas between the values
std::string check_length(std::size_t length, const Limits& limits);

/// A list of fixed length; of two values, as in 490x380 too.
template <class T, std::size_t N>
std::string read_value(std::string_view text, const Limits& limits, std::array<T, N>& values) {
  const auto pieces = split(text, N == 2 ? ",x" : ",");
  const bool one = limits.one_for_all && pieces.size() == 1;
  if (pieces.size() != N && !one) {
    return fmt::format("'{}' is not {}{}", text.substr(0, 60), limits.one_for_all ? "one or " : "",
                       N == 2   ? "two numbers; write them as A,B or AxB"
                       : N == 3 ? "three numbers; write them as X,Y,Z"
                                : "four numbers; write them with commas between");
  }
  std::array<T, N> read{};
  for (std::size_t i = 0; i < N; ++i) {
    if (auto wrong = read_value(trimmed(pieces[one ? 0 : i]), limits, read[i]); !wrong.empty()) return wrong;
  }
  values = read;
  return {};
}
template <class T>
std::string read_value(std::string_view text, const Limits& limits, std::vector<T>& values) {
  std::vector<T> read;
  for (const std::string_view piece : text.empty() ? std::vector<std::string_view>() : split(text, ",")) {
    if (auto wrong = read_value(trimmed(piece), limits, read.emplace_back()); !wrong.empty()) return wrong;
  }
  if (auto wrong = check_length(read.size(), limits); !wrong.empty()) return wrong;
  values = std::move(read);
  return {};
}
template <std::ranges::sized_range List>
std::string check_value(const List& values, const Limits& limits) {
  for (const auto& value : values) {
    if (auto wrong = check_value(value, limits); !wrong.empty()) return wrong;
  }
  return check_length(values.size(), limits);
}
template <std::ranges::sized_range List>
std::string value_text(const List& values) {
  std::string text;
  for (const auto& value : values) text += (text.empty() ? "" : ",") + value_text(value);
  return text;
}

// --- values that may be absent; absent ones have no text
template <class T>
std::string read_value(std::string_view text, const Limits& limits, std::optional<T>& value) {
  T read{};
  auto wrong = read_value(text, limits, read);
  if (wrong.empty()) value = std::move(read);
  return wrong;
}
template <class T>
std::string check_value(const std::optional<T>& value, const Limits& limits) {
  return value ? check_value(*value, limits) : std::string();
}
template <class T>
std::string value_text(const std::optional<T>& value) {
  return value ? value_text(*value) : std::string();
}

// --- words of a fixed list, and their values
template <class Value>
struct Word {
  std::string_view word;
  Value value;
};

/// An error that lists `words` and suggests the nearest one: "... none, raster; did you mean 'raster'?"
std::string not_one_of(std::string_view text, std::span<const std::string_view> words);

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
std::vector<std::string_view> words_of(const Word<Value> (&words)[N]) {
  std::vector<std::string_view> names;
  for (const Word<Value>& row : words) names.push_back(row.word);
  return names;
}

/// The word for a value; empty if none.
template <class Value, std::size_t N>
std::string write_word(const Word<Value> (&words)[N], Value value) {
  for (const auto& [word, meaning] : words) {
    if (meaning == value) return std::string(word);
  }
  return {};
}

/// The name of a file or directory.
std::string check_path(std::string_view text);

}  // namespace lamina
