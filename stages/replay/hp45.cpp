// stages/write/program/hp45/README.md tells the format.
#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "stages/replay/dialects.h"
#include "stages/replay/gcode.h"

namespace lamina::replay {
namespace {

int digit_of(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  return c == '+' ? 62 : c == '/' ? 63 : -1;
}

/// A whole number in base 64, the highest digit first; 0 at a fault.
std::int64_t read_base64(std::string_view text, GcodeReader& reader) {
  const bool negative = text.starts_with('-');
  if (negative) text.remove_prefix(1);
  std::int64_t value = 0;
  if (text.empty() || text.size() > 6) return reader.fault("a position that is no number"), 0;
  for (const char c : text) {
    if (digit_of(c) < 0) return reader.fault("a position that is no number in base 64"), 0;
    value = value * 64 + digit_of(c);
  }
  return negative ? -value : value;
}

}  // namespace

void read_hp45(std::string_view text, Printing& printing) {
  GcodeReader reader(text, printing);
  Axes axes(printing, reader);
  GcodeLine line;
  const ScanAxes scan(printing.profile());
  std::vector<std::pair<std::int64_t, std::vector<std::uint64_t>>> loaded;
  std::uint32_t sweep = 0;
  bool ended = false;
  while (reader.next(line)) {
    if (ended) return reader.fault("goes on behind BRES");
    if (line.command == "BCL") {
      if (!loaded.empty()) return reader.fault("lines that were sent are cleared before the head moved");
    } else if (line.command == "SBR") {
      if (loaded.empty()) printing.reading_sweep(sweep);
      const std::size_t gap = line.rest.find(' ');
      if (gap == std::string_view::npos || line.rest.size() - gap - 1 != 50)
        return reader.fault("SBR has a position and 50 characters");
      const std::string_view raw = line.rest.substr(gap + 1);
      std::vector<std::uint64_t> words((printing.nozzles() + 63) / 64, 0);
      for (std::uint32_t nozzle = 0; nozzle < 300; ++nozzle) {
        const int digit = digit_of(raw[nozzle / 6]);
        if (digit < 0) return reader.fault("a character that is not of base 64");
        if ((digit >> (5 - nozzle % 6) & 1) == 0) continue;
        if (nozzle >= printing.nozzles()) return reader.fault(fmt::format("nozzle {} does not exist", nozzle));
        words[nozzle / 64] |= std::uint64_t{1} << (63 - nozzle % 64);
      }
      loaded.emplace_back(printing.step_at(static_cast<double>(read_base64(line.rest.substr(0, gap), reader)) / 1000), words);
      printing.reading_step(loaded.back().first);
    } else if (line.command == "G1" && !loaded.empty()) {
      const double from = axes.at(scan.along);
      axes.take(line, true);
      const double to = axes.at(scan.along);
      const bool towards_end = printing.position_of(1) > printing.position_of(0);
      printing.begin_sweep(sweep++, (to > from) != towards_end);
      printing.go_across(axes.at(scan.across));
      for (const auto& [step, words] : loaded) {
        printing.at_step(step);
        const double at = printing.position_of(static_cast<double>(step));
        if (at < std::min(from, to) - 1e-3 || at > std::max(from, to) + 1e-3)
          return printing.fault("the head does not come over this step");
        printing.fire_words(words);
        if (!printing.ok()) return;
      }
      loaded.clear();
    } else if (line.command == "BRES") {
      ended = true;
    } else if (!axes.take(line, false)) {
      return reader.fault(fmt::format("'{}' is no command of the dialect hp45", line.command));
    }
  }
  if (!ended || !loaded.empty()) return printing.fault("the program ends before BRES");
}

}  // namespace lamina::replay
