// stages/program/raw/README.md has the format.
#include <vector>

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
  std::vector<std::uint64_t> vector(std::size_t{words} * planes * 2);
  printing.lowest_bits_first();
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
        std::uint64_t any = 0;
        // Each word is a number of 128 bits, the highest byte first; bit i is nozzle i of the word.
        for (std::size_t w = 0; w < vector.size(); ++w) {
          any |= vector[w] = __builtin_bswap64(little_endian<std::uint64_t>(bytes.data() + 8 * (w ^ 1)));
        }
        if (any == 0) continue;
        printing.at_step(step);
        passes.at(step, printing.fire_words(vector, planes));
      }
    }
  }
}

}  // namespace lamina::replay
