// pipeline/flow/layer_steps.h: the steps that layers take, and the limits of their flow.
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

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

}  // namespace lamina::pipeline
