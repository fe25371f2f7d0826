// Reads the text dialects hp45, brundlefab and m578: the READMEs in stages/write/program/.
#include <fmt/format.h>

#include <charconv>

#include "stages/replay/replay_gcode.h"

namespace lamina::pipeline {
namespace {

/// Which axes carry the head along and across the scan.
struct ScanAxes {
  std::string along, across;
  explicit ScanAxes(const Machine& machine) {
    const bool x = machine.mounting.scan_axis == ScanAxis::kX;
    along = x ? machine.motion.x_axis : machine.motion.y_axis;
    across = x ? machine.motion.y_axis : machine.motion.x_axis;
  }
};

int digit_of(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  return c == '+' ? 62 : c == '/' ? 63 : -1;
}

/// A whole number in base 64, the highest digit first.
std::int64_t read_base64(std::string_view text, GcodeReader& reader) {
  const bool negative = text.starts_with('-');
  if (negative) text.remove_prefix(1);
  std::int64_t value = 0;
  if (text.empty() || text.size() > 6) reader.fault("a position that is no number");
  for (const char c : text) {
    if (digit_of(c) < 0) reader.fault("a position that is no number in base 64");
    value = value * 64 + digit_of(c);
  }
  return negative ? -value : value;
}

}  // namespace

void replay_hp45(std::string_view text, Printing& printing) {
  GcodeReader reader(text, printing);
  Axes axes(printing, reader);
  GcodeLine line;
  const ScanAxes scan(printing.profile());
  std::vector<std::pair<std::int64_t, std::vector<std::uint64_t>>> loaded;
  std::uint32_t sweep = 0;
  bool ended = false;
  while (reader.next(line)) {
    if (ended) reader.fault("goes on behind BRES");
    if (line.command == "BCL") {
      if (!loaded.empty()) reader.fault("lines that were sent are cleared before the head moved");
    } else if (line.command == "SBR") {
      if (loaded.empty()) printing.reading_sweep(sweep);
      const std::size_t gap = line.rest.find(' ');
      if (gap == std::string_view::npos || line.rest.size() - gap - 1 != 50)
        reader.fault("SBR has a position and 50 characters");
      const std::string_view raw = line.rest.substr(gap + 1);
      std::vector<std::uint64_t> words((printing.nozzles() + 63) / 64, 0);
      for (std::uint32_t nozzle = 0; nozzle < 300; ++nozzle) {
        const int digit = digit_of(raw[nozzle / 6]);
        if (digit < 0) reader.fault("a character that is not of base 64");
        if ((digit >> (5 - nozzle % 6) & 1) == 0) continue;
        if (nozzle >= printing.nozzles()) reader.fault(fmt::format("nozzle {} does not exist", nozzle));
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
          printing.fault("the head does not come over this step");
        printing.fire_words(words);
      }
      loaded.clear();
    } else if (line.command == "BRES") {
      ended = true;
    } else if (!axes.take(line, false)) {
      reader.fault(fmt::format("'{}' is no command of the dialect hp45", line.command));
    }
  }
  if (!ended || !loaded.empty()) printing.fault("the program ends before BRES");
}

void replay_brundlefab(std::string_view text, Printing& printing) {
  GcodeReader reader(text, printing);
  Axes axes(printing, reader);
  GcodeLine line;
  const ScanAxes scan(printing.profile());
  std::vector<std::uint64_t> words;  // of T1; empty: no ink
  std::uint32_t sweep = 0;
  bool in_sweep = false, begun = false, ended = false;
  while (reader.next_comment(line)) {
    if (ended) reader.fault("goes on behind its end");
    if (line.command == "M117") {
      const std::string_view want = begun ? "Done" : "Slice";
      if (!line.rest.starts_with(fmt::format("{} {}", want, printing.layer() + 1))) reader.fault("M117 is not of this layer");
      ended = begun;
      begun = true;
    } else if (line.command == "T0" || line.command == "T21") {
      words.clear();
      in_sweep = false;
    } else if (line.command == "T1") {
      if (!in_sweep) printing.reading_sweep(sweep);
      std::uint64_t bits[3] = {reader.count(line, 'P'), reader.count(line, 'Q'), reader.count(line, 'R')};
      words.assign((printing.nozzles() + 63) / 64, 0);
      for (std::uint32_t nozzle = 0; nozzle < 72; ++nozzle) {
        if ((bits[nozzle / 24] >> (nozzle % 24) & 1) == 0) continue;
        if (nozzle >= printing.nozzles()) reader.fault(fmt::format("nozzle {} does not exist", nozzle));
        words[nozzle / 64] |= std::uint64_t{1} << (63 - nozzle % 64);
      }
    } else if (line.command == "G1" && !words.empty()) {
      const std::int64_t from = printing.step_at(axes.at(scan.along));
      axes.take(line, true);
      const std::int64_t to = printing.step_at(axes.at(scan.along));
      if (!in_sweep) {
        printing.begin_sweep(sweep++, to < from);
        printing.go_across(axes.at(scan.across));
        in_sweep = true;
      }
      if (to == from) reader.fault("jets without moving");
      const std::int64_t ahead = to > from ? 1 : -1;
      for (std::int64_t step = from + ahead;; step += ahead) {
        printing.at_step(step);
        printing.fire_words(words);
        if (step == to) break;
      }
    } else if (!axes.take(line, false)) {
      reader.fault(fmt::format("'{}' is no command of the dialect brundlefab", line.command));
    }
  }
  if (!ended) printing.fault("the program ends before its last line");
}

void replay_m578(std::string_view text, Printing& printing) {
  GcodeReader reader(text, printing);
  Axes axes(printing, reader);
  GcodeLine line;
  const ScanAxes scan(printing.profile());
  std::uint32_t sweep = 0;
  bool in_sweep = false, ended = false;
  double begin = 0;
  std::int64_t step = INT64_MIN;
  while (reader.next(line)) {
    if (ended) reader.fault("goes on behind M400");
    if (line.command == "M578") {
      const double at = axes.at(scan.along);
      if (!in_sweep) printing.reading_sweep(sweep);
      const std::int64_t now = printing.step_at(at);
      if (!in_sweep) {
        const bool towards_end = printing.position_of(1) > printing.position_of(0);
        printing.begin_sweep(sweep++, (at > begin) != towards_end);
        printing.go_across(axes.at(scan.across));
        in_sweep = true;
        step = INT64_MIN;
      }
      if (now != step) printing.at_step(now);
      step = now;
      const std::uint32_t head = reader.count(line, 'P'), bits = reader.count(line, 'S');
      for (std::uint32_t bit = 0; bit < 32; ++bit) {
        if ((bits >> bit & 1) != 0) printing.fire(head * 32 + bit);
      }
    } else if (line.command == "M400") {
      ended = true;
    } else {
      if (line.command == "G0") in_sweep = false;
      if (!axes.take(line, in_sweep)) reader.fault(fmt::format("'{}' is no command of the dialect m578", line.command));
      if (line.command == "G0" && line.has(scan.along[0])) begin = axes.at(scan.along);
    }
  }
  if (!ended) printing.fault("the program ends before M400");
}

}  // namespace lamina::pipeline
