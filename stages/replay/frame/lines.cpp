#include "stages/replay/frame/lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/replay/gcode.h"

namespace lamina::replay::frame {

double ProgramLine::value(char letter) const { return has(letter) ? word.at(letter) : std::nan(""); }

Result<std::vector<ProgramLine>> lines_of(std::string_view text) {
  std::vector<ProgramLine> lines;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return wrong(fmt::format("line {}: ends within a line", number));
    std::string_view left = text.substr(0, end);
    text.remove_prefix(end + 1);
    left = left.substr(0, left.find(';'));
    while (left.ends_with(' ')) left.remove_suffix(1);
    if (left.empty()) continue;
    ProgramLine line;
    line.number = number;
    line.command = left.substr(0, left.find(' '));
    left.remove_prefix(std::min(line.command.size() + 1, left.size()));
    const bool has_words = std::string_view("GMT").find(line.command[0]) != std::string_view::npos && line.command != "M117";
    if (const auto what = has_words ? add_words(left, line.word) : std::nullopt)
      return wrong(fmt::format("line {}: '{}' is no word", number, *what));
    lines.push_back(std::move(line));
  }
  return lines;
}

bool has_word(std::string_view words, std::string_view word) {
  return fmt::format(" {} ", words).find(fmt::format(" {} ", word)) != std::string::npos;
}

std::uint32_t number_at(std::string_view bytes, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < 4; ++i) number |= std::uint32_t{static_cast<std::uint8_t>(bytes[at + i])} << (8 * i);
  return number;
}

}  // namespace lamina::replay::frame
