// Reads the binary dialects raw and planes: the READMEs in stages/write/program/.
#include <fmt/format.h>

#include "stages/replay/replay_printing.h"

namespace lamina::pipeline {
namespace {

/// Numbers out of a text of bytes, the lowest byte first.
class ByteReader {
 public:
  ByteReader(std::string_view bytes, Printing& printing) : left_(bytes), all_(bytes.size()), printing_(printing) {}

  std::string_view take(std::size_t count) {
    if (count > left_.size()) fault(fmt::format("ends where {} bytes should follow", count));
    const std::string_view taken = left_.substr(0, count);
    left_.remove_prefix(count);
    return taken;
  }
  std::uint64_t number(std::size_t bytes) {
    std::uint64_t value = 0;
    const std::string_view taken = take(bytes);
    for (std::size_t i = 0; i < bytes; ++i) value |= std::uint64_t{static_cast<std::uint8_t>(taken[i])} << (8 * i);
    return value;
  }
  std::uint32_t word() { return static_cast<std::uint32_t>(number(4)); }
  bool done() const { return left_.empty(); }
  [[noreturn]] void fault(const std::string& what) const {
    printing_.fault(fmt::format("byte {}: {}", all_ - left_.size(), what));
  }

 private:
  std::string_view left_;
  std::size_t all_;
  Printing& printing_;
};

/// Movement that the data alone tells: from the first to the last step of a sweep.
class ScanLength {
 public:
  explicit ScanLength(Printing& printing) : printing_(printing) {}
  void begin() { end(), any_ = false; }
  void at(std::int64_t step) {
    if (!any_) first_ = step;
    last_ = step;
    any_ = true;
  }
  void end() {
    if (!any_) return;
    const double mm =
        std::abs(printing_.position_of(static_cast<double>(last_)) - printing_.position_of(static_cast<double>(first_)));
    printing_.head_moves(mm + 2 * printing_.profile().motion.ramp_mm, printing_.profile().motion.scan_speed_mm_s, true);
    any_ = false;
  }

 private:
  Printing& printing_;
  std::int64_t first_ = 0, last_ = 0;
  bool any_ = false;
};

}  // namespace

void replay_raw(std::string_view text, Printing& printing) {
  ByteReader reader(text, printing);
  ScanLength length(printing);
  if (reader.take(4) != "LAYR" || reader.word() != printing.layer()) reader.fault("does not begin with this layer");
  reader.take(3 * 4);
  printing.count.vats = reader.word();
  const std::uint32_t words = (printing.nozzles() + 127) / 128;
  while (true) {
    const std::string_view tag = reader.take(4);
    if (tag == "LEND") {
      if (reader.word() != printing.layer() || !reader.done()) reader.fault("the end is not of this layer, or not the end");
      length.end();
      return;
    }
    if (tag != "SWTH") reader.fault("neither a swath nor the end");
    const std::uint32_t number = reader.word();
    reader.word();
    const bool backward = reader.word() == 1;
    length.begin();
    printing.begin_sweep(number, backward);
    printing.go_across(static_cast<double>(static_cast<std::int64_t>(reader.number(8))) / 1e6);
    for (std::uint32_t segments = reader.word(); segments > 0; --segments) {
      std::int64_t step = reader.word();
      for (std::uint32_t left = reader.word(); left > 0; --left, step += backward ? -1 : 1) {
        const std::string_view bytes = reader.take(std::size_t{words} * 16);
        bool any = false;
        for (const char c : bytes) any = any || c != 0;
        if (!any) continue;
        printing.at_step(step);
        length.at(step);
        // Each word is a number of 128 bits, the highest byte first; bit i is nozzle i of the word.
        for (std::uint32_t nozzle = 0; nozzle < words * 128; ++nozzle) {
          const auto byte = static_cast<std::uint8_t>(bytes[nozzle / 128 * 16 + 15 - nozzle % 128 / 8]);
          if ((byte >> (nozzle % 8) & 1) != 0) printing.fire(nozzle);
        }
      }
    }
  }
}

void replay_planes(std::string_view text, Printing& printing) {
  ByteReader reader(text, printing);
  ScanLength length(printing);
  const std::uint32_t words = (printing.nozzles() + 31) / 32;
  std::uint32_t sweep = UINT32_MAX;
  const bool layer = reader.word() == 0x4C01;
  const std::uint32_t counts = reader.word();
  if (!layer || (counts != 4 && counts != 5) || reader.word() != printing.layer())
    reader.fault("does not begin with this layer");
  reader.take(3 * 4);
  printing.count.vats = counts == 5 ? reader.word() : 1;
  std::vector<std::vector<std::uint64_t>> rows;
  while (true) {
    const std::uint32_t command = reader.word(), size = reader.word();
    if (command == 0x4C03) {
      if (size != 1 || reader.word() != printing.layer() || !reader.done())
        reader.fault("the end is not of this layer, or not the end");
      length.end();
      return;
    }
    if (command != 0x4C02) reader.fault("neither a plane nor the end");
    const std::uint32_t number = reader.word();
    reader.word();
    const bool backward = reader.word() == 1;
    const auto across = static_cast<std::int32_t>(reader.word());
    if (number != sweep) {
      length.begin();
      printing.begin_sweep(number, backward);
      printing.go_across(across / 1e6);
      sweep = number;
    }
    const std::int64_t first = reader.word();
    const std::uint32_t steps = reader.word();
    if (reader.word() != words || size != 7 + std::uint64_t{steps} * words) reader.fault("a plane of another width");
    const std::string_view plane = reader.take(std::size_t{steps} * words * 4);
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
      length.at(first + place);
      printing.fire_words(vector);
    }
  }
}

}  // namespace lamina::pipeline
