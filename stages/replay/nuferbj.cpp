// stages/write/program/nuferbj/README.md tells the format.
#include <fmt/format.h>

#include <charconv>

#include "stages/replay/dialects.h"
#include "stages/replay/gcode.h"

namespace lamina::replay {
namespace {

/// J<step> and words of eight hexadecimal digits, read from left to right as nozzles 0, 1, 2, ...
struct Vector {
  std::int64_t step = 0;
  std::vector<std::uint64_t> words;
};

/// At a fault the vector may be of other words than the head.
Vector read_vector(const GcodeLine& line, GcodeReader& reader, std::uint32_t nozzles) {
  Vector vector;
  const std::string_view number = line.command.substr(1);
  const auto [stop, error] = std::from_chars(number.data(), number.data() + number.size(), vector.step);
  if (error != std::errc() || stop != number.data() + number.size()) reader.fault("a vector without a step");
  const std::uint32_t groups = (nozzles + 31) / 32;
  if (line.rest.size() != std::size_t{groups} * 9 - 1) {
    reader.fault(fmt::format("a vector of {} characters where {} nozzles have {}", line.rest.size(), nozzles, groups * 9 - 1));
    return vector;
  }
  vector.words.assign((groups + 1) / 2, 0);
  for (std::uint32_t group = 0; group < groups; ++group) {
    const char* digits = line.rest.data() + std::size_t{group} * 9;
    std::uint32_t bits = 0;
    const auto [end, wrong] = std::from_chars(digits, digits + 8, bits, 16);
    if (wrong != std::errc() || end != digits + 8 || (group > 0 && digits[-1] != ' '))
      reader.fault("a word that is no hexadecimal number");
    vector.words[group / 2] |= std::uint64_t{bits} << (group % 2 == 0 ? 32 : 0);
  }
  return vector;
}

}  // namespace

void read_nuferbj(std::string_view text, Printing& printing) {
  GcodeReader reader(text, printing);
  Axes axes(printing, reader);
  GcodeLine line;
  if (!reader.next(line) || line.command != "M811" || reader.count(line, 'L') != printing.layer()) {
    return printing.fault("the program does not begin with M811 of this layer");
  }
  const ScanAxes scan(printing.profile());
  std::vector<Vector> loaded;  // fired by the next G1 along the scan
  bool in_sweep = false, backward = false, ended = false;
  while (reader.next(line)) {
    if (ended) return reader.fault("goes on behind M813");
    if (line.command == "M812") {
      if (in_sweep) return reader.fault("a swath begins before the last one was scanned");
      backward = reader.count(line, 'D') == 1;
      printing.begin_sweep(reader.count(line, 'S'), backward);
      in_sweep = true;
    } else if (line.command[0] == 'J') {
      if (!in_sweep) return reader.fault("a vector outside of a swath");
      loaded.push_back(read_vector(line, reader, printing.nozzles()));
      printing.reading_step(loaded.back().step);
    } else if (line.command[0] == 'R') {
      std::uint32_t repeats = 0;
      const std::string_view number = line.command.substr(1);
      const auto [stop, error] = std::from_chars(number.data(), number.data() + number.size(), repeats);
      if (loaded.empty() || error != std::errc() || stop != number.data() + number.size() || repeats > 100'000'000) {
        return reader.fault("R repeats no vector");
      }
      for (std::uint32_t k = 0; k < repeats; ++k) {
        loaded.push_back(loaded.back());
        loaded.back().step += backward ? -1 : 1;
      }
    } else if (line.command == "G1" && in_sweep && line.has(scan.along[0])) {
      const double from = axes.at(scan.along);
      printing.go_across(axes.at(scan.across));
      axes.take(line, true);
      const double to = axes.at(scan.along), low = std::min(from, to), high = std::max(from, to);
      for (const Vector& vector : loaded) {
        printing.at_step(vector.step);
        const double at = printing.position_of(static_cast<double>(vector.step));
        if (at < low - 1e-3 || at > high + 1e-3) return printing.fault("the head does not come over this step");
        printing.fire_words(vector.words);
        if (!printing.ok()) return;
      }
      loaded.clear();
      in_sweep = false;
    } else if (line.command == "M813") {
      if (in_sweep || reader.count(line, 'L') != printing.layer()) return reader.fault("the layer ends within a swath");
      ended = true;
    } else if (!axes.take(line, false)) {
      return reader.fault(fmt::format("'{}' is no command of the dialect nuferbj", line.command));
    }
  }
  if (!ended) return printing.fault("the program ends before M813");
}

}  // namespace lamina::replay
