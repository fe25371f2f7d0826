// pipeline/flow/layers.h: a oneTBB flow graph that moves layers through named steps to an ordered record, within a memory
// budget.
//
//      source ──> slots ──> credits ──> gate ──> queue ──> step ──> gate ──> queue ──> step ──> ... ──> step
//                   ^       ^  ^  ^ │    ^                           │ ^                                 │
//                   │       │  │  │ └────┴───────────────────────────┼─┘ has its bytes                   │
//                   │       │  │  └──────────────────────────────────┘ needs bytes                       │
//                   │       │  └─────────────────────────────────────────────────────────────────────────┘
//                   │       └───────────────────────── record <── order <─┐ is done
//                   └──────────── is recorded ─────────────────── credits ┘
//
//      source   input_node                   layers in order, until the last or the flow is stopped
//      slots    limiter_node                 at most FlowLimits::record_slots layers begun and not recorded
//      credits  multifunction_node, serial   lends scratch and bytes: pipeline/flow/credits.h
//      gate     multifunction_node, inline   sends a layer that needs bytes to `credits`, others to the step's queue
//      queue    priority_queue_node          the oldest layer first
//      step     function_node, rejecting     as many layers at once as there are threads
//      order    sequencer_node
//      record   function_node, serial
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
#include <string_view>
#include <vector>

#include "pipeline/flow/layer_steps.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Seconds in a node, over all threads.
struct NodeTime {
  std::string_view name;
  double busy = 0;
  double processor = 0;  // 0 unless FlowLimits::processor_times
};

struct FlowReport {
  std::uint32_t max_in_flight = 0;
  std::uint64_t max_bytes = 0;  // peak of the credits, idle scratch included
  std::uint32_t oversized = 0;  // layers that held more than the budget by themselves
  NodeTime credits = {};
  std::vector<NodeTime> steps = {};  // each step and "record"
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
