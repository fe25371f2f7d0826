#include "stages/formats/gcode/replay/deposited_beads.h"

#include <cmath>
#include <utility>

namespace lamina::formats::gcode {
namespace {

/// splitmix64 (Steele, Lea, Flood 2014).
std::uint64_t mixed(std::uint64_t value) {
  value += 0x9e3779b97f4a7c15;
  value = (value ^ value >> 30) * 0xbf58476d1ce4e5b9;
  value = (value ^ value >> 27) * 0x94d049bb133111eb;
  return value ^ value >> 31;
}

}  // namespace

void DepositedBeads::next_layer() {
  ++layer_;
  size_ = 0;
}

DepositedBeads::BeadSlot& DepositedBeads::slot_of(std::uint64_t hash) {
  const std::size_t mask = slots_.size() - 1;
  std::size_t at = hash & mask;
  while (slots_[at].layer == layer_ && slots_[at].hash != hash) at = (at + 1) & mask;
  return slots_[at];
}

void DepositedBeads::grow() {
  std::vector<BeadSlot> old = std::exchange(slots_, std::vector<BeadSlot>(slots_.size() * 2));
  for (const BeadSlot& slot : old) {
    if (slot.layer == layer_) slot_of(slot.hash) = slot;
  }
}

bool DepositedBeads::add(const double (&from)[3], const double (&to)[3]) {
  std::uint64_t hash = 0;
  for (const double at : {from[0], from[1], to[0], to[1], to[2]}) {
    hash = mixed(hash ^ static_cast<std::uint64_t>(std::llround(at * 1000)));
  }
  BeadSlot& slot = slot_of(hash);
  if (slot.layer == layer_) return true;
  slot = {hash, layer_};
  if (++size_ * 2 > slots_.size()) grow();
  return false;
}

}  // namespace lamina::formats::gcode
