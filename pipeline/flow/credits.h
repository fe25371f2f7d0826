// pipeline/flow/credits.h: decides which layers of a flow may continue, by their bytes. Body of the serial node `credits`.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "pipeline/flow/layers.h"

namespace lamina::pipeline {

/// Corrects estimated bytes by what finished layers held. The largest ratio of the last layers counts, with a margin that
/// shrinks as evidence grows. Small layers say little: both sides of a ratio are taken with 256 KiB more.
class Correction {
 public:
  /// The estimate as experience has it: never above it, as it is before any layer has finished.
  std::uint64_t operator()(std::uint64_t estimate) const {
    if (learned_ == 0) return estimate;
    double ratio = 0;
    for (const double one : last_) ratio = std::max(ratio, one);
    const double share = ratio * (1.5 + 4.0 / static_cast<double>(learned_));
    return static_cast<std::uint64_t>(std::min(static_cast<double>(estimate), share * static_cast<double>(estimate + kSmall)));
  }

  void learn(std::uint64_t estimate, std::uint64_t held) {
    const auto with_margin = [](std::uint64_t bytes) { return static_cast<double>(bytes + kSmall); };
    last_[learned_++ % last_.size()] = with_margin(held) / with_margin(estimate);
  }

 private:
  static constexpr std::uint64_t kSmall = 1 << 18;
  std::array<double, 32> last_{};
  std::uint64_t learned_ = 0;
};

/// Slots are lent last in, first out, so that few of them grow large. Memory of an idle slot counts as used and is freed
/// before a layer would have to wait for it. Thread-compatible.
class Budget {
 public:
  /// let_go  frees the buffers of an idle slot; outlives this object
  Budget(std::uint64_t bytes, std::uint32_t slots, const std::function<void(std::uint32_t)>& let_go)
      : budget_(bytes), let_go_(let_go) {
    for (std::uint32_t slot = slots; slot-- > 0;) idle_.push_back({slot, 0});
  }

  struct Loan {
    std::uint32_t slot = 0;
    std::uint64_t bytes = 0;
  };

  /// A slot and `bytes` for a layer, or nothing if it must wait. A layer larger than the budget runs alone.
  std::optional<Loan> take(std::uint64_t bytes) {
    if (in_flight_ > 0 && (idle_.empty() || used_ + bytes > budget_)) return std::nullopt;
    ensure_capacity(bytes);
    Loan loan = idle_.back();
    idle_.pop_back();
    idle_bytes_ -= loan.bytes;
    loan.bytes = std::max(loan.bytes, bytes);
    ++in_flight_;
    use(loan.bytes);
    max_in_flight_ = std::max(max_in_flight_, in_flight_);
    return loan;
  }

  bool fits(std::uint64_t bytes) const { return used_ + bytes <= budget_; }

  /// Sets the bytes of a layer in flight, even beyond the budget.
  void settle(Loan& loan, std::uint64_t bytes) {
    if (bytes > loan.bytes) ensure_capacity(bytes - loan.bytes);
    used_ -= loan.bytes;
    loan.bytes = bytes;
    use(bytes);
  }

  /// retained  bytes of the slot's buffers
  void give_back(const Loan& loan, std::uint64_t retained) {
    --in_flight_;
    used_ -= loan.bytes;
    idle_.push_back({loan.slot, retained});
    idle_bytes_ += retained;
  }

  /// Bytes that no layer holds, and that they leave room for.
  void hold_extra(std::uint64_t bytes) {
    used_ -= std::exchange(adjacent_, bytes);
    use(bytes);
  }

  std::uint64_t bytes() const { return budget_; }
  std::uint32_t max_in_flight() const { return max_in_flight_; }
  std::uint64_t max_bytes() const { return max_bytes_; }

 private:
  void use(std::uint64_t bytes) {
    used_ += bytes;
    max_bytes_ = std::max(max_bytes_, used_ + idle_bytes_);
  }

  void ensure_capacity(std::uint64_t bytes) {
    for (Loan& slot : idle_) {  // the last slot is lent next, so it is emptied last
      if (used_ + idle_bytes_ + bytes <= budget_) return;
      if (slot.bytes == 0) continue;
      idle_bytes_ -= slot.bytes;
      let_go_(slot.slot);
      slot.bytes = 0;
    }
  }

  std::uint64_t budget_;
  const std::function<void(std::uint32_t)>& let_go_;
  std::vector<Loan> idle_;  // each with its retained bytes
  std::uint32_t in_flight_ = 0, max_in_flight_ = 0;
  std::uint64_t used_ = 0;  // by layers in flight and beside them
  std::uint64_t adjacent_ = 0;
  std::uint64_t idle_bytes_ = 0;  // of idle slots
  std::uint64_t max_bytes_ = 0;
};

/// A layer begun and not recorded. One node has it at a time: only that node may read or change it.
struct LayerState {
  /// Has no scratch yet; is between two steps; takes no more steps; is recorded.
  enum class Phase : std::uint8_t { kArrived, kStepping, kDone, kRecorded };
  Ticket ticket;
  Status status = {};
  Phase phase = Phase::kArrived;
  std::uint32_t step = 0;   // to be taken next
  bool needs_more = false;  // the next step has requested `more` bytes
  std::optional<Budget::Loan> loan = {};
  std::uint64_t estimate = 0, more = 0, held = 0;  // bytes: for the admission; from the next step on; the largest so far
  std::uint64_t extra = 0;                         // bytes that the recorder keeps, once recorded
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
