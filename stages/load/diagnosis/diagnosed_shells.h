// stages/load/diagnosis/diagnosed_shells.h: what a diagnosis says of shells; internal to load.
#pragma once

#include <span>

#include "stages/data/mesh.h"
#include "stages/load/repair/diagnose.h"
#include "stages/load/repair/geometry.h"

namespace lamina::load {

struct Shell {
  Int128 volume = 0;  // sixfold
  Box box;
  bool closed = true;

  void add(const Shell& other) {
    volume += other.volume;
    box.add(other.box);
    closed = closed && other.closed;
  }
};

/// Counts shells, and says where they are. result  whose edges and bounds are known
void describe_shells(std::span<const Shell> shells, Diagnosis& result);

}  // namespace lamina::load
