// pipeline/flow/layers.h: a oneTBB flow graph that moves layers through named steps to an ordered record, within a memory
// budget.
//
//      heights ──> slots ──> credits ──> gate ──> queue ──> step ──> gate ──> queue ──> step ──> ... ──> step
//         │          ^       ^  ^  ^ │    ^                           │ ^                                 │
//         │          │       │  │  │ └────┴───────────────────────────┼─┘ has its bytes                   │
//         │          │       │  │  └──────────────────────────────────┘ needs bytes                       │
//         │          │       │  └─────────────────────────────────────────────────────────────────────────┘
//         │          │       └─────────── record <── order <───┐ is done
//         │          └── is recorded ──────────────── credits ─┘
//         └──> all are decided ────────────> order
//
//      heights  input_node                   layers in order, until the last or the flow is stopped
//      slots    limiter_node                 at most FlowLimits::record_slots layers begun and not recorded
//      credits  multifunction_node, serial   lends scratch and bytes: pipeline/flow/credits.h
//      gate     multifunction_node, inline   sends a layer that needs bytes to `credits`, others to the step's queue
//      queue    priority_queue_node          the oldest layer first
//      step     function_node, rejecting     as many layers at once as there are threads
//      order    sequencer_node
//      record   function_node, serial
//
// `heights` decides layers while earlier ones are made, if the job lets it (LayerSteps::decide). A program, a file of slices or
// toolpaths, a TIFF with a title, a shard and a range of layers state or need the number of layers first, and the optimal mode
// decides from the top down: for these, all layers are decided before the flow, and `heights` counts. A manifest states the
// number, too: so the message that all layers are decided is the first in `order`; layers that are made before it wait there.
// Decided layers wait in a queue before `slots`, 24 bytes each.
//
// Messages are layers. Each is in one node at a time, so no node needs a lock. A layer that failed or is given up travels on as
// a message, past all steps: its bytes return and the layers after it keep their order. `record` receives every layer once and
// in order, which makes the first failure well defined; it skips all layers from the first failure on.
//
// A thread that has taken a step continues with the next one of the same layer, because the node starts its successor's task on
// the thread it runs on; later steps therefore go before earlier ones. Priorities of nodes would prevent that: oneTBB 2021
// takes any task with a priority before the one without that hands a layer from a queue to its step.
//
// The flow is independent of the job: the caller owns a layer's scratch (slot `work`) and its results until they are recorded
// (slot `record`).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "stages/data/status.h"
#include "stages/support/clocks.h"

namespace lamina::pipeline {

/// The token that passes from step to step.
struct Ticket {
  std::uint32_t position = 0;  // index among the layers of this flow, from 0
  std::uint32_t work = 0;      // slot of scratch, below FlowLimits::max_in_flight
  std::uint32_t record = 0;    // slot of the results, below FlowLimits::record_slots
};

struct Step {
  std::string_view name;  // of static storage
  std::function<Status(const Ticket&)> run;
  /// Optional, not for the first step: bytes that this and later steps may need in addition to those of the admission.
  std::function<Result<std::uint64_t>(const Ticket&)> needs = {};
};

/// The processing of a layer. A slot serves one layer at a time; no step is called after one has failed.
struct LayerSteps {
  /// Optional: decides whether there is a layer at a position, in order, while earlier ones are made; `decided` follows, before
  /// the first layer is recorded. One call at a time. Without it, all layers are decided.
  std::function<bool(std::uint32_t position)> decide = {};
  std::function<Status()> decided = {};
  std::function<std::uint64_t(std::uint32_t position)> bytes_of;  // estimate for the admission; one call at a time
  std::vector<Step> steps;                                        // at least one
  std::function<Status(const Ticket&)> record;                    // one at a time, in order; an error ends the flow
  std::function<std::uint64_t(std::uint32_t work)> bytes_held;    // of a slot's buffers
  std::function<void(std::uint32_t work)> let_go;                 // frees the buffers of an idle slot
  std::function<std::uint64_t()> extra_bytes = {};                // optional: that `record` keeps, called after each
  /// Whether `record` reads the scratch: a layer then keeps it until recorded, otherwise until its last step.
  bool records_from_work = false;
};

struct FlowLimits {
  std::uint64_t budget_bytes = 1ull << 30;
  std::uint32_t max_in_flight = 1;  // layers with scratch
  std::uint32_t record_slots = 32;  // layers begun and not recorded: the most that an interruption loses
  bool processor_times = false;     // measured of each node: two calls of the system each
};

/// Seconds in a node, over all threads.
struct NodeTime {
  std::string_view name;
  Elapsed busy;  // no processor time unless FlowLimits::processor_times
};

struct FlowReport {
  std::uint32_t max_in_flight = 0;
  std::uint64_t max_bytes = 0;       // peak of the credits, idle scratch included
  std::uint32_t oversized = 0;       // layers that held more than the budget by themselves
  std::vector<NodeTime> nodes = {};  // "heights" if it decides, "credits", each step, "record"
};

/// Moves layers 0 to count - 1, or as many as steps.decide decides.
/// cancel  once set, no layer is admitted; those in flight have 0.3 s to finish, then they are given up before their next
///         step. The error is kInterrupted
/// errors  of the first failing layer in layer order; kMemory: a step ran out of memory; kInterrupted
Status flow_layers(std::uint32_t count, const LayerSteps& steps, const FlowLimits& limits, const std::atomic<bool>& cancel,
                   FlowReport& report);

/// Twice the number of threads, so that no thread waits for a layer.
std::uint32_t layers_in_flight();

}  // namespace lamina::pipeline
