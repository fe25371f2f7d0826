// pipeline/flow/credits.h: decides which layers of a flow may continue, by their bytes. Body of the serial node `credits`.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "pipeline/flow/budget.h"
#include "pipeline/flow/layer_steps.h"

namespace lamina::pipeline {

/// A layer begun and not recorded. One node has it at a time: only that node may read or change it.
struct LayerState {
  enum class Phase : std::uint8_t {
    kArrived,   // has no scratch yet
    kStepping,  // between two steps
    kDone,      // has taken all steps, or takes no more
    kRecorded,
  };
  Ticket ticket;
  Status status = {};
  Phase phase = Phase::kArrived;
  std::uint32_t step = 0;   // to be taken next
  bool needs_more = false;  // the next step has requested `more` bytes
  std::optional<Budget::Loan> loan = {};
  std::uint64_t estimate = 0, more = 0, held = 0;  // bytes: for the admission; from the next step on; the largest so far
  std::uint64_t extra = 0;                     // bytes that the recorder keeps, once recorded
};

/// Lends scratch and bytes to layers: in order while their estimated bytes fit the budget. What finished layers held corrects
/// the estimates. A layer whose next step needs more waits until that fits; none overtakes an older one that waits for more.
/// The next layer to be recorded never waits, so loans exceed the budget by at most one layer.
/// Thread-compatible: the node is serial.
class Credits {
 public:
  using Leaving = std::span<LayerState* const>;

  /// stopped  once true, no layer is admitted; those that arrive are done with kInterrupted. All arguments outlive this
  Credits(const LayerSteps& steps, const FlowLimits& limits, const std::function<bool()>& stopped);

  /// Begins the next layer; at most FlowLimits::record_slots are begun and not recorded.
  /// returns  the layers that leave, valid until the next call: kStepping ones may take their next step, kDone ones are to be
  ///          recorded
  Leaving begin(std::uint32_t position);
  /// Takes a layer that waits for bytes, that is done, or that is recorded; a recorded one is not to be used any more.
  Leaving receive(LayerState& layer);

  const Budget& budget() const { return budget_; }
  std::uint32_t oversized() const { return oversized_; }  // layers that held more than the budget by themselves

 private:
  void take_back(LayerState& layer);
  void end(LayerState& layer);
  bool admit(LayerState& layer);
  bool may_continue(LayerState& layer);
  Leaving wake();

  const LayerSteps& steps_;
  const std::function<bool()>& stopped_;
  Budget budget_;
  Correction admission_, whole_;      // of the estimates before and after a step that needs more
  std::vector<LayerState> layers_;    // by record slot
  std::vector<std::uint32_t> free_;   // record slots
  std::vector<LayerState*> waiting_;  // by position; those without scratch are the last
  std::vector<LayerState*> leaving_;
  std::uint32_t recorded_ = 0, oversized_ = 0;
  std::uint32_t recorded_from_ = 0;  // the last layer whose recorder's bytes are known: messages of `record` may overtake
};

}  // namespace lamina::pipeline
