// stages/heights/table.h: the layers of a job from the bottom up.
#pragma once

#include <cstdint>
#include <string>

#include "stages/data/buffer.h"
#include "stages/data/layer.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::heights {

/// Layers without gap or overlap, from height 0. A uniform table holds no layer and makes them on demand; any other one
/// holds 12 bytes a layer.
class LayerTable {
 public:
  /// height, thickness  nm, > 0
  /// The last layer counts even where it is only partly filled: ceil(height / thickness) layers.
  static LayerTable uniform(std::int64_t height, Nm thickness) {
    LayerTable table;
    table.thickness_ = thickness;
    table.count_ = static_cast<std::uint32_t>(ceil_div<std::int64_t>(height, thickness));
    return table;
  }
  LayerTable() = default;

  /// Layers are then added without moving the others; not of a uniform table.
  void reserve(std::uint32_t layers) { entries_.reserve(layers); }
  std::size_t capacity() const { return entries_.capacity(); }
  void add(Nm thickness, LayerReason reason) {
    entries_.push_back({static_cast<Nm>(top()), thickness, reason});
    ++count_;
  }

  /// Takes the last layer away; not of a uniform table.
  void drop_last() {
    entries_.pop_back();
    --count_;
  }

  std::uint32_t size() const { return count_; }
  Layer operator[](std::uint32_t index) const {
    if (thickness_ > 0) {
      return {index, static_cast<Nm>(std::int64_t{index} * thickness_), thickness_, LayerReason::kUniform};
    }
    const LayerEntry& entry = entries_[index];
    return {index, entry.bottom, entry.thickness, entry.reason};
  }
  /// Where the last layer ends, nm.
  std::int64_t top() const {
    if (thickness_ > 0) return std::int64_t{count_} * thickness_;
    return count_ == 0 ? 0 : std::int64_t{entries_.back().bottom} + entries_.back().thickness;
  }

 private:
  struct LayerEntry {
    Nm bottom, thickness;
    LayerReason reason;
  };
  Nm thickness_ = 0;  // > 0: uniform, and nothing is stored
  std::uint32_t count_ = 0;
  Buffer<LayerEntry> entries_;
};

// --- whether the build vat of a powder printer can make a table of layers.

/// Empty, or a warning if some layers end between two steps of the vat.
/// errors  kUsage: a layer thinner than a step
/// cost    O(layers)
Result<std::string> check_build_steps(const Machine& machine, const LayerTable& table);

}  // namespace lamina::heights
