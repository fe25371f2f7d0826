// stages/replay/frame/lines.h: the few lines about a program, read on their own.
#pragma once

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina::replay::frame {

inline Error wrong(std::string what) { return {Fault::kVerification, std::move(what)}; }

struct Line {
  std::size_t at_line = 0;  // from 1
  std::string command;
  std::map<char, double> word;

  bool has(char letter) const { return word.contains(letter); }
  /// NaN if there is none.
  double number(char letter) const { return has(letter) ? word.at(letter) : std::nan(""); }
};

/// Without comments and empty lines. Words behind M117 are text. errors  kVerification: a word that is no letter and number
inline Result<std::vector<Line>> lines_of(std::string_view text) {
  std::vector<Line> lines;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return wrong(fmt::format("line {}: ends within a line", number));
    std::string_view left = text.substr(0, end);
    text.remove_prefix(end + 1);
    left = left.substr(0, left.find(';'));
    while (left.ends_with(' ')) left.remove_suffix(1);
    if (left.empty()) continue;
    Line line;
    line.at_line = number;
    line.command = left.substr(0, left.find(' '));
    left.remove_prefix(line.command.size());
    while (!left.empty() && line.command != "M117") {
      left.remove_prefix(1);
      const std::string_view word = left.substr(0, left.find(' '));
      double value = 0;
      const char* const to = word.data() + word.size();
      if (word.size() < 2 || std::from_chars(word.data() + 1, to, value, std::chars_format::fixed).ptr != to ||
          !std::isfinite(value)) {
        return wrong(fmt::format("line {}: '{}' is no word", number, word));
      }
      line.word[word[0]] = value;
      left.remove_prefix(word.size());
    }
    lines.push_back(std::move(line));
  }
  return lines;
}

/// Whether a word is one of those that blanks part.
inline bool has_word(std::string_view words, std::string_view word) {
  return fmt::format(" {} ", words).find(fmt::format(" {} ", word)) != std::string::npos;
}

/// Of four bytes, the lowest first.
inline std::uint32_t at_lineat(std::string_view bytes, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < 4; ++i) number |= std::uint32_t{static_cast<std::uint8_t>(bytes[at + i])} << (8 * i);
  return number;
}

}  // namespace lamina::replay::frame
