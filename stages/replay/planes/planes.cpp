// stages/program/planes/README.md has the format.
#include <array>
#include <bit>
#include <optional>
#include <vector>

#include "stages/replay/bytes.h"

namespace lamina::replay {
namespace {

constexpr std::uint32_t kLayer = 0x4C01, kPlane = 0x4C02, kEnd = 0x4C03, kGrey = 0x4C06;

/// Words of a row of u32, the highest bit of the first one in bit 63 of the first word.
void read_row(const char* row, std::uint32_t words, std::uint64_t* to) {
  for (std::uint32_t w = 0; w + 1 < words; w += 2, row += 8) *to++ = std::rotl(little_endian<std::uint64_t>(row), 32);
  if (words % 2 != 0) *to = std::uint64_t{little_endian<std::uint32_t>(row)} << 32;
}

/// The rows of a plane, or of the planes of a grey one, and what each step of them fires.
class PlaneRows {
 public:
  PlaneRows(std::string_view bytes, std::uint32_t steps, std::uint32_t words, std::uint32_t planes)
      : bytes_(bytes), steps_(steps), words_(words), planes_(planes), vector_(std::size_t{planes} * ((words + 1) / 2)) {}

  void fire(std::uint32_t row, std::int64_t step, Printing& printing, Passes& passes) {
    std::uint64_t any = 0;
    for (std::size_t p = 0; p < planes_; ++p) {
      read_row(bytes_.data() + (p * steps_ + row) * words_ * 4, words_, vector_.data() + p * ((words_ + 1) / 2));
    }
    for (const std::uint64_t word : vector_) any |= word;
    if (any == 0) return;
    printing.at_step(step);
    passes.at(step, printing.fire_words(vector_, planes_));
  }

 private:
  std::string_view bytes_;
  std::uint32_t steps_, words_, planes_;
  std::vector<std::uint64_t> vector_;  // of each plane
};

}  // namespace

void read_planes(std::string_view text, Printing& printing) {
  ByteReader reader(text, printing);
  Passes passes(printing);
  const std::uint32_t words = (printing.nozzles() + 31) / 32, bits = printing.drop_bits(), grey = bits > 1 ? 1 : 0;
  std::optional<std::array<std::uint32_t, 4>> sweep;  // number, of, direction, position of the one at hand
  const bool layer = reader.word() == kLayer;
  const std::uint32_t counts = reader.word();
  if (!layer || (counts != 4 && counts != 5) || reader.word() != printing.layer())
    return reader.fault("does not begin with this layer");
  printing.state_layers(reader.word());
  const double bottom_mm = reader.mm();
  printing.state_heights(bottom_mm, reader.mm());
  printing.count.vats = counts == 5 ? reader.word() : 1;
  while (printing.ok()) {
    take_maintenance_records(reader, printing, passes);
    const std::uint32_t command = reader.word(), size = reader.word();
    if (command == kEnd) {
      if (size != 1 || reader.word() != printing.layer() || !reader.done())
        return reader.fault("the end is not of this layer, or not the end");
      passes.end();
      return;
    }
    if (command != (grey != 0 ? kGrey : kPlane)) return reader.fault("neither a plane nor the end");
    std::array<std::uint32_t, 4> head{};
    for (std::uint32_t& word : head) word = reader.word();
    const auto [number, of, direction, position] = head;
    if (direction > 1) return reader.fault("a sweep runs there, 0, or back, 1");
    const bool backward = direction == 1;
    if (sweep != head) {
      const double across_mm = static_cast<std::int32_t>(position) / 1e6;
      printing.begin_sweep(number, backward, of);
      printing.go_across(across_mm);
      passes.begin(across_mm, backward);
      sweep = head;
    }
    const std::int64_t first = reader.word();
    const std::uint32_t steps = reader.word();
    if (reader.word() != words || size != 7 + grey + std::uint64_t{steps} * words * bits)
      return reader.fault("a plane of another width");
    if (grey != 0 && reader.word() != bits) return reader.fault("a plane of other bits");
    PlaneRows rows(reader.take(std::size_t{steps} * words * bits * 4), steps, words, bits);
    for (std::uint32_t k = 0; k < steps && printing.ok(); ++k) {
      const std::uint32_t row = backward ? steps - 1 - k : k;
      rows.fire(row, first + row, printing, passes);
    }
  }
}

}  // namespace lamina::replay
