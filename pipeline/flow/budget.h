// pipeline/flow/budget.h: lends scratch slots and a memory budget to layers.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

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
  struct ScratchHooks {
    const std::function<std::uint64_t(std::uint32_t)>& bytes_held;
    const std::function<void(std::uint32_t)>& let_go;
  };
  Budget(std::uint64_t bytes, std::uint32_t slots, ScratchHooks scratch) : budget_(bytes), scratch_(scratch) {
    for (std::uint32_t slot = slots; slot-- > 0;) idle_.push_back({slot, 0});
  }

  struct Loan {
    std::uint32_t slot = 0;
    std::uint64_t bytes = 0;
  };

  /// A slot and `bytes` for a layer, or nothing if it must wait. A layer larger than the budget runs alone.
  std::optional<Loan> take(std::uint64_t bytes) {
    if (in_flight_ > 0 && (idle_.empty() || used_ + bytes > budget_)) return std::nullopt;
    free_memory(bytes);
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
    if (bytes > loan.bytes) free_memory(bytes - loan.bytes);
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
    used_ -= std::exchange(extra_, bytes);
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

  void free_memory(std::uint64_t bytes) {
    for (Loan& slot : idle_) {  // the last slot is lent next, so it is emptied last
      if (used_ + idle_bytes_ + bytes <= budget_) return;
      if (slot.bytes == 0) continue;
      idle_bytes_ -= slot.bytes;
      scratch_.let_go(slot.slot);
      slot.bytes = 0;
    }
  }

  std::uint64_t budget_;
  ScratchHooks scratch_;
  std::vector<Loan> idle_;  // each with its retained bytes
  std::uint32_t in_flight_ = 0, max_in_flight_ = 0;
  std::uint64_t used_ = 0;  // by layers in flight and beside them
  std::uint64_t extra_ = 0;
  std::uint64_t idle_bytes_ = 0;  // of idle slots
  std::uint64_t max_bytes_ = 0;
};

}  // namespace lamina::pipeline
