// stages/program/drop_bits.h: lines of drops become lines of the bits of their number.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/program/fire.h"

namespace lamina::program {

/// What each nozzle of a sweep fires, as a line for each bit of the number of drops, the lowest first. Flat, kept from sweep to
/// sweep.
class DropBits {
 public:
  /// Most bits of a number of drops.
  static constexpr std::uint32_t kMost = 4;

  /// bits  1 .. kMost
  void begin(std::uint32_t bits);
  /// The next nozzle. drops  line k, from 0, has the places of more than k drops, each within the one before; fewer than
  /// 2 ^ bits. cost  O(drops x changes)
  void add(std::span<const Line> drops);
  /// The lines of all nozzles added, those of the lowest bit first; they live until begin().
  /// nozzle  of nozzles x bits
  void end(std::span<Line> nozzle) const;

  std::uint64_t bytes() const;

 private:
  std::uint32_t bits_ = 1;
  std::array<Buffer<std::uint32_t>, kMost> change_;  // of all nozzles, for each bit
  std::array<Buffer<std::uint32_t>, kMost> end_;     // where those of a nozzle end
  std::vector<std::size_t> next_;
};

}  // namespace lamina::program
