// pipeline/flow/layers.h: layers move through named steps to one ordered end: the flow graph and its memory budget.
//
//      admit ──> step ──> step ──> ... ──> in order ──> record
//        ^                          │                     │
//        └──── credits in bytes ────┴─────────────────────┘
//
// The graph moves numbers and knows no job: the caller owns the scratch of a layer (slot `work`) and what is kept of it
// until it is recorded (slot `record`). Layers are admitted in order while the bytes that they may need fit the budget.
// A step may learn what the rest of a layer needs: the layer then passes, in order too, when that fits as well. The next
// layer to be recorded passes whatever it needs, so credits stay within the budget and what one layer exceeds it by.
// Steps run for many layers at once; `record` sees every layer once and in order, and so decides which failure is the
// first.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// What travels from step to step.
struct Ticket {
  std::uint32_t position = 0;  // of the layer among those that move, from 0
  std::uint32_t work = 0;      // slot of scratch, below FlowLimits::most_in_flight
  std::uint32_t record = 0;    // slot of what is recorded, below FlowLimits::record_slots
};

struct Step {
  std::string_view name;  // of static storage
  std::function<Status(const Ticket&)> run;
  /// Optional: bytes that this step and those behind it may need beside what the layer was admitted with.
  std::function<Result<std::uint64_t>(const Ticket&)> needs = {};
};

/// What is done with a layer. A slot is used by one layer at a time; a step is not called once one has failed.
struct LayerSteps {
  std::function<std::uint64_t(std::uint32_t position)> bytes_of;  // that a layer may need, before anything is known of it
  std::vector<Step> steps;                                        // at least one
  std::function<Status(const Ticket&)> record;                    // one at a time, in order; an error ends the flow
  std::function<std::uint64_t(std::uint32_t work)> bytes_held;    // of a slot's buffers
  std::function<void(std::uint32_t work)> let_go;                 // frees the buffers of an idle slot
  /// `record` reads the scratch: a layer keeps it until it is recorded. Else it is given back behind the last step.
  bool records_from_work = false;
};

struct FlowLimits {
  std::uint64_t budget_bytes = 1ull << 30;
  std::uint32_t most_in_flight = 1;  // layers with scratch of their own; bounds the work that an interruption loses
  std::uint32_t record_slots = 256;  // layers that may be ahead of a slow lower one
};

struct FlowReport {
  std::uint32_t most_in_flight = 0;
  std::uint64_t most_bytes = 0;                                   // of credits given out at once, idle scratch included
  std::vector<std::pair<std::string_view, double>> step_seconds;  // of each step and of "record", over all threads
};

/// Moves layers 0 to count - 1.
/// cancel  read before each admission: layers in flight are finished and recorded, then the error is kInterrupted
/// errors  the first failing layer's, in layer order, or kInterrupted
Status flow_layers(std::uint32_t count, const LayerSteps& steps, const FlowLimits& limits, const std::atomic<bool>& cancel,
                   FlowReport& report);

/// Twice the threads that may run: enough that no thread waits for a layer.
std::uint32_t layers_in_flight();

}  // namespace lamina::pipeline
