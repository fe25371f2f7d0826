// pipeline/flow/layers.h: a flow graph that moves layers through named steps to an ordered record, within a memory budget.
//
//      admit ──> step ──> step ──> ... ──> in order ──> record
//        ^                          │                     │
//        └──── credits in bytes ────┴─────────────────────┘
//
// The flow moves indices and is independent of the job: the caller owns a layer's scratch (slot `work`) and its results
// until they are recorded (slot `record`). Layers are admitted in order while their estimated bytes fit the budget; what
// finished layers held corrects the estimates. A step may tell more exactly what the layer needs from there on: the layer
// then waits until it fits. The next layer to be recorded never waits, so credits exceed the budget by at most one layer.
//
// Each step is a node of the graph. Steps run for many layers at once; later steps go before earlier ones, and each takes
// its oldest layer. So what is finished is soon on record: at most FlowLimits::record_slots layers are begun and not recorded,
// whatever ends the program. `record` receives every layer once and in order, which makes the first failure well defined.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// The token that passes from step to step.
struct Ticket {
  std::uint32_t position = 0;  // index among the layers of this flow, from 0
  std::uint32_t work = 0;      // slot of scratch, below FlowLimits::most_in_flight
  std::uint32_t record = 0;    // slot of the results, below FlowLimits::record_slots
};

struct Step {
  std::string_view name;  // of static storage
  std::function<Status(const Ticket&)> run;
  /// Optional: bytes that this and later steps may need in addition to those of the admission.
  std::function<Result<std::uint64_t>(const Ticket&)> needs = {};
};

/// The processing of a layer. A slot serves one layer at a time; no step is called after one has failed.
struct LayerSteps {
  std::function<std::uint64_t(std::uint32_t position)> bytes_of;  // estimate for the admission
  std::vector<Step> steps;                                        // at least one
  std::function<Status(const Ticket&)> record;                    // one at a time, in order; an error ends the flow
  std::function<std::uint64_t(std::uint32_t work)> bytes_held;    // of a slot's buffers
  std::function<void(std::uint32_t work)> let_go;                 // frees the buffers of an idle slot
  std::function<std::uint64_t()> bytes_beside = {};               // optional: that `record` holds, asked after each
  /// Whether `record` reads the scratch: a layer then keeps it until recorded, otherwise until its last step.
  bool records_from_work = false;
};

struct FlowLimits {
  std::uint64_t budget_bytes = 1ull << 30;
  std::uint32_t most_in_flight = 1;  // layers with scratch
  std::uint32_t record_slots = 32;   // layers begun and not recorded: the most that an interruption loses
  bool processor_times = false;      // measured of each step: two calls of the system each
};

struct FlowReport {
  std::uint32_t most_in_flight = 0;
  std::uint64_t most_bytes = 0;                                   // peak of the credits, idle scratch included
  std::uint32_t oversized = 0;                                    // layers that held more than the budget by themselves
  std::vector<std::pair<std::string_view, double>> step_seconds;  // of each step and of "record", over all threads
  std::vector<double> step_processor_seconds;                     // of the threads that took them, 0 unless asked for
  double lock_seconds = 0;                                        // waited for the flow's own lock, over all threads
};

/// Moves layers 0 to count - 1.
/// cancel  once set, no layer is admitted; those in flight have 0.3 s to finish, then they are given up before their next
///         step. The error is kInterrupted
/// errors  of the first failing layer in layer order; kMemory: a step ran out of memory; kInterrupted
Status flow_layers(std::uint32_t count, const LayerSteps& steps, const FlowLimits& limits, const std::atomic<bool>& cancel,
                   FlowReport& report);

/// Twice the number of threads, so that no thread waits for a layer.
std::uint32_t layers_in_flight();

}  // namespace lamina::pipeline
