#include "stages/replay/bytes.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

namespace lamina::replay {
namespace {

constexpr std::uint32_t kPlanesFirst = 0x4C10;  // GOTO
constexpr std::uint32_t kLongestOwn = 15;       // words of a line of the machine's own

struct RecordKind {
  std::string_view tag;
  std::uint32_t minimum, maximum;  // numbers that it has
};
constexpr std::array<RecordKind, 8> kKinds = {{{"GOTO", 2, 2},
                                               {"FILL", 0, 0},
                                               {"BASE", 2, 2},
                                               {"ROLL", 1, 1},
                                               {"WIPE", 3, 3},
                                               {"SPIT", 1, 1},
                                               {"DRYS", 1, 1},
                                               {"LINE", 1, kLongestOwn}}};

/// The record that follows; nullptr if another one does.
const RecordKind* kind_ahead(const ByteReader& reader, bool planes) {
  const std::string_view tag = reader.ahead(4);
  if (tag.size() < 4) return nullptr;
  if (!planes) {
    const auto found = std::ranges::find(kKinds, tag, &RecordKind::tag);
    return found == kKinds.end() ? nullptr : &*found;
  }
  std::uint32_t command = 0;
  for (std::size_t i = 0; i < 4; ++i) command |= std::uint32_t{static_cast<std::uint8_t>(tag[i])} << (8 * i);
  return command < kPlanesFirst || command - kPlanesFirst >= kKinds.size() ? nullptr : &kKinds[command - kPlanesFirst];
}

double mm_of(std::uint32_t nm) { return static_cast<std::int32_t>(nm) / 1e6; }

class Carer {
 public:
  Carer(ByteReader& reader, Printing& printing, Passes& passes) : reader_(reader), printing_(printing), passes_(passes) {}

  void take(const RecordKind& kind) {
    reader_.take(4);
    const std::uint32_t count = reader_.word();
    if (!printing_.ok()) return;
    if (count < kind.minimum || count > kind.maximum) {
      return reader_.fault(fmt::format("{} of {} numbers, where {} are", kind.tag, count, kind.minimum));
    }
    std::array<std::uint32_t, kLongestOwn> n{};
    for (std::uint32_t i = 0; i < count; ++i) n[i] = reader_.word();
    if (printing_.ok()) carry_out(kind.tag, {n.data(), count});
  }

 private:
  void carry_out(std::string_view tag, std::span<const std::uint32_t> n) {
    const auto& profile = printing_.profile();
    if (tag != "GOTO") printing_.state_host(tag, tag == "FILL" || tag == "BASE" || tag == "ROLL");
    if (tag == "GOTO") return passes_.visit(mm_of(n[0]), mm_of(n[1]), 0);
    if (tag == "FILL") return printing_.refills();
    if (tag == "BASE") return printing_.state_base(n[0], n[1] / 1e6);
    if (tag == "ROLL") return printing_.roller_turns(n[0] / 1e3);
    if (tag == "WIPE") {
      if (n[2] == 0) return reader_.fault("WIPE at no speed");
      return passes_.visit(mm_of(n[0]), mm_of(n[1]), n[2] / 1e3);
    }
    if (tag == "SPIT") {
      passes_.stop();
      return printing_.spits(passes_.x_mm(), passes_.y_mm(), n[0], n[0] / profile.head.highest_frequency_hz);
    }
    passes_.stop();
    if (tag == "DRYS") return printing_.dwells(n[0] / 1e3);
    std::string line;
    for (const std::uint32_t word : n) {
      for (int i = 0; i < 4; ++i) line += static_cast<char>(word >> (8 * i) & 255);
    }
    while (line.ends_with('\0')) line.pop_back();
    if (!printing_.takes_own(line)) reader_.fault(fmt::format("'{}' is not one of the machine's own lines here", line));
  }

  ByteReader& reader_;
  Printing& printing_;
  Passes& passes_;
};

}  // namespace

void take_maintenance_records(ByteReader& reader, Printing& printing, Passes& passes) {
  const bool planes = printing.profile().dialect == "planes";
  Carer carer(reader, printing, passes);
  while (printing.ok()) {
    const RecordKind* const kind = kind_ahead(reader, planes);
    if (kind == nullptr) return;
    carer.take(*kind);
  }
}

}  // namespace lamina::replay
