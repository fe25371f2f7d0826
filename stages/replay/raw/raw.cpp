// stages/program/raw/README.md has the format.
#include "stages/replay/bytes.h"

namespace lamina::replay {

void read_raw(std::string_view text, Printing& printing) {
  ByteReader reader(text, printing);
  Passes passes(printing);
  if (reader.take(4) != "LAYR" || reader.word() != printing.layer()) return reader.fault("does not begin with this layer");
  printing.state_layers(reader.word());
  const double bottom_mm = reader.mm();
  printing.state_heights(bottom_mm, reader.mm());
  printing.count.vats = reader.word();
  const std::uint32_t words = (printing.nozzles() + 127) / 128, planes = printing.drop_bits();
  while (printing.ok()) {
    take_maintenance_records(reader, printing, passes);
    const std::string_view tag = reader.take(4);
    if (tag == "LEND") {
      if (reader.word() != printing.layer() || !reader.done())
        return reader.fault("the end is not of this layer, or not the end");
      passes.end();
      return;
    }
    if (tag != "SWTH") return reader.fault("neither a swath nor the end");
    const std::uint32_t number = reader.word(), of = reader.word(), direction = reader.word();
    if (direction > 1) return reader.fault("a sweep runs there, 0, or back, 1");
    const bool backward = direction == 1;
    printing.begin_sweep(number, backward, of);
    const double across = static_cast<double>(static_cast<std::int64_t>(reader.number(8))) / 1e6;
    printing.go_across(across);
    passes.begin(across, backward);
    for (std::uint32_t segments = reader.word(); segments > 0 && printing.ok(); --segments) {
      std::int64_t step = reader.word();
      for (std::uint32_t left = reader.word(); left > 0; --left, step += backward ? -1 : 1) {
        const std::string_view bytes = reader.take(std::size_t{words} * planes * 16);
        if (!printing.ok()) return;
        bool any = false;
        for (const char c : bytes) any = any || c != 0;
        if (!any) continue;
        printing.at_step(step);
        // Each word is a number of 128 bits, the highest byte first; bit i is nozzle i of the word.
        std::uint32_t maximum = 0;
        for (std::uint32_t nozzle = 0; nozzle < words * 128; ++nozzle) {
          std::uint32_t drops = 0;
          for (std::uint32_t plane = 0; plane < planes; ++plane) {
            const auto byte = static_cast<std::uint8_t>(bytes[(plane * words + nozzle / 128) * 16 + 15 - nozzle % 128 / 8]);
            drops += static_cast<std::uint32_t>(byte >> (nozzle % 8) & 1) << plane;
          }
          maximum = std::max(maximum, drops);
          if (drops > 0) printing.fire(nozzle, drops);
        }
        passes.at(step, maximum);
      }
    }
  }
}

}  // namespace lamina::replay
