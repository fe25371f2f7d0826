// stages/write/program/brundlefab/README.md tells the format.
#include <fmt/format.h>

#include <vector>

#include "stages/replay/dialects.h"
#include "stages/replay/gcode.h"

namespace lamina::replay {

void read_brundlefab(std::string_view text, Printing& printing) {
  GcodeReader reader(text, printing);
  Axes axes(printing, reader);
  GcodeLine line;
  const ScanAxes scan(printing.profile());
  std::vector<std::uint64_t> words;  // of T1; empty: no ink
  std::uint32_t sweep = 0;
  bool in_sweep = false, begun = false, ended = false;
  while (reader.next_comment(line)) {
    if (ended) return reader.fault("goes on behind its end");
    if (line.command == "M117") {
      const std::string_view want = begun ? "Done" : "Slice";
      if (!line.rest.starts_with(fmt::format("{} {}", want, printing.layer() + 1)))
        return reader.fault("M117 is not of this layer");
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
        if (nozzle >= printing.nozzles()) return reader.fault(fmt::format("nozzle {} does not exist", nozzle));
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
      if (to == from) return reader.fault("jets without moving");
      const std::int64_t ahead = to > from ? 1 : -1;
      for (std::int64_t step = from + ahead;; step += ahead) {
        printing.at_step(step);
        printing.fire_words(words);
        if (step == to || !printing.ok()) break;
      }
    } else if (!axes.take(line, false)) {
      return reader.fault(fmt::format("'{}' is no command of the dialect brundlefab", line.command));
    }
  }
  if (!ended) return printing.fault("the program ends before its last line");
}

}  // namespace lamina::replay
