// stages/write/program/planes/README.md tells the format.
#include <vector>

#include "stages/replay/bytes.h"
#include "stages/replay/care/records.h"
#include "stages/replay/dialects.h"

namespace lamina::replay {

void read_planes(std::string_view text, Printing& printing) {
  ByteReader reader(text, printing);
  Passes passes(printing);
  const std::uint32_t words = (printing.nozzles() + 31) / 32;
  std::uint32_t sweep = UINT32_MAX;
  const bool layer = reader.word() == 0x4C01;
  const std::uint32_t counts = reader.word();
  if (!layer || (counts != 4 && counts != 5) || reader.word() != printing.layer())
    return reader.fault("does not begin with this layer");
  reader.take(3 * 4);
  printing.count.vats = counts == 5 ? reader.word() : 1;
  while (printing.ok()) {
    take_care_records(reader, printing, passes);
    const std::uint32_t command = reader.word(), size = reader.word();
    if (command == 0x4C03) {
      if (size != 1 || reader.word() != printing.layer() || !reader.done())
        return reader.fault("the end is not of this layer, or not the end");
      passes.end();
      return;
    }
    if (command != 0x4C02) return reader.fault("neither a plane nor the end");
    const std::uint32_t number = reader.word();
    reader.word();
    const bool backward = reader.word() == 1;
    const auto across = static_cast<std::int32_t>(reader.word());
    if (number != sweep) {
      printing.begin_sweep(number, backward);
      printing.go_across(across / 1e6);
      passes.begin(across / 1e6, backward);
      sweep = number;
    }
    const std::int64_t first = reader.word();
    const std::uint32_t steps = reader.word();
    if (reader.word() != words || size != 7 + std::uint64_t{steps} * words) return reader.fault("a plane of another width");
    const std::string_view plane = reader.take(std::size_t{steps} * words * 4);
    if (!printing.ok()) return;
    for (std::uint32_t k = 0; k < steps; ++k) {
      const std::uint32_t place = backward ? steps - 1 - k : k;
      const char* row = plane.data() + std::size_t{place} * words * 4;
      std::vector<std::uint64_t> vector((words + 1) / 2, 0);
      bool any = false;
      for (std::uint32_t w = 0; w < words; ++w) {
        std::uint64_t bits = 0;
        for (int byte = 0; byte < 4; ++byte) bits |= std::uint64_t{static_cast<std::uint8_t>(row[4 * w + byte])} << (8 * byte);
        vector[w / 2] |= w % 2 == 0 ? bits << 32 : bits;
        any = any || bits != 0;
      }
      if (!any) continue;
      printing.at_step(first + place);
      passes.at(first + place);
      printing.fire_words(vector);
    }
  }
}

}  // namespace lamina::replay
