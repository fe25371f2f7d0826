// stages/write/program/m578/README.md tells the format.
#include <fmt/format.h>

#include "stages/replay/dialects.h"
#include "stages/replay/gcode.h"

namespace lamina::replay {

void read_m578(std::string_view text, Printing& printing) {
  GcodeReader reader(text, printing);
  Axes axes(printing, reader);
  GcodeLine line;
  const ScanAxes scan(printing.profile());
  std::uint32_t sweep = 0;
  bool in_sweep = false, ended = false;
  double begin = 0;
  std::int64_t step = INT64_MIN;
  while (reader.next(line)) {
    if (ended) return reader.fault("goes on behind M400");
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
      if (!axes.take(line, in_sweep)) return reader.fault(fmt::format("'{}' is no command of the dialect m578", line.command));
      if (line.command == "G0" && line.has(scan.along[0])) begin = axes.at(scan.along);
    }
  }
  if (!ended) return printing.fault("the program ends before M400");
}

}  // namespace lamina::replay
