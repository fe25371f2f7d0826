// stages/replay/time/timer.h: how long a machine takes for a layer, found out while its program is written.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/replay/machine.h"

namespace lamina::replay {

/// Times layers by the same movements as a replay of their programs, whose drops do not matter here. Kept from layer to layer
/// for its memory; one for each thread.
class Timer {
 public:
  /// machine  outlives this object
  explicit Timer(const VirtualMachine& machine) : machine_(&machine) {}

  /// Whether read() leaves the lines out that load vectors.
  static bool keeps_no_vectors(std::string_view dialect);
  void begin(const Layer& layer);
  /// Dialects with motion: the next lines of the program, whole ones. Memory: the layer's text, without the vectors of nuferbj,
  /// hp45 and oasis.
  void read(std::span<const std::byte> lines);
  /// Dialects without: the next sweep, by its first and last step that fire, in the order of the movement.
  /// across_mm  of the carriage
  /// added      it is there since nozzles cannot fire all of their drops at the scan's speed
  /// drops      the most of a nozzle at a place
  void sweep(double across_mm, bool backward, std::int64_t first, std::int64_t last, bool added = false,
             std::uint32_t drops = 1);
  /// The same: records of care, before the next sweep and behind the last one.
  void maintenance(std::span<const std::byte> records);
  /// The layer's time, and its care. errors  kInternal: the machine's reader does not take the program
  Result<Count> end();
  /// How much of it is that of added sweeps; the others are as they would be without them. After end().
  std::int64_t added_microseconds() const { return added_microseconds_; }

  std::uint64_t bytes() const { return text_.capacity() + sweeps_.capacity() * sizeof(TimedSweep); }

 private:
  struct TimedSweep {
    double across_mm;
    bool backward, added;
    std::int64_t first, last;
    std::uint32_t drops;
    std::size_t maintenance;  // bytes of text_ that come before it
  };
  Result<Count> pass(bool all) const;
  const VirtualMachine* machine_;
  Layer layer_{};
  std::string text_;  // of dialects with motion; of others their records of care
  std::vector<TimedSweep> sweeps_;
  std::int64_t added_microseconds_ = 0;
};

}  // namespace lamina::replay
