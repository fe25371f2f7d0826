// stages/replay/frame/lines.h: the few lines about a program, read on their own.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina::replay::frame {

inline Error wrong(std::string what) { return {Fault::kVerification, std::move(what)}; }

struct ProgramLine {
  std::size_t number = 0;  // from 1
  std::string command;
  std::map<char, double> word;

  bool has(char letter) const { return word.contains(letter); }
  /// NaN if there is none.
  double value(char letter) const;
};

/// Without comments and empty lines; only G, M and T commands have words, and M117 has text.
/// errors  kVerification, with the line: a word that is no letter and number, an end within a line
Result<std::vector<ProgramLine>> lines_of(std::string_view text);

/// Whether a word is one of those that blanks part.
bool has_word(std::string_view words, std::string_view word);

/// Of the four bytes from `at` on, the lowest first.
std::uint32_t number_at(std::string_view bytes, std::size_t at);

}  // namespace lamina::replay::frame
