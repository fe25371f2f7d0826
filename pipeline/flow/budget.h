// pipeline/flow/budget.h: lends scratch slots and a memory budget to layers.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

namespace lamina::pipeline {

/// Slots are lent last in, first out, so that few of them grow large. Memory of an idle slot counts as used and is freed
/// before a layer would have to wait for it. Thread-compatible: callers hold a lock.
class Budget {
 public:
  struct Scratch {
    const std::function<std::uint64_t(std::uint32_t)>& bytes_held;
    const std::function<void(std::uint32_t)>& let_go;
  };
  Budget(std::uint64_t bytes, std::uint32_t slots, Scratch scratch) : budget_(bytes), scratch_(scratch) {
    for (std::uint32_t slot = slots; slot-- > 0;) idle_.push_back({slot, 0});
  }

  struct Loan {
    std::uint32_t slot = 0;
    std::uint64_t bytes = 0;
  };

  /// A slot and `bytes` for a layer, or nothing if it must wait. A layer larger than the budget runs alone.
  std::optional<Loan> take(std::uint64_t bytes) {
    if (in_flight_ > 0 && (idle_.empty() || used_ + bytes > budget_)) return std::nullopt;
    make_room(bytes);
    Loan loan = idle_.back();
    idle_.pop_back();
    idle_bytes_ -= loan.bytes;
    loan.bytes = std::max(loan.bytes, bytes);
    ++in_flight_;
    use(loan.bytes);
    most_in_flight_ = std::max(most_in_flight_, in_flight_);
    return loan;
  }

  bool fits(std::uint64_t bytes) const { return used_ + bytes <= budget_; }

  /// Adds bytes to a layer in flight, even beyond the budget.
  void add(std::uint64_t bytes) {
    make_room(bytes);
    use(bytes);
  }

  /// Corrects a layer's bytes from `before` to `now`.
  void settle(std::uint64_t before, std::uint64_t now) {
    used_ -= before;
    use(now);
  }

  void give_back(const Loan& loan) {
    --in_flight_;
    used_ -= loan.bytes;
    idle_.push_back({loan.slot, scratch_.bytes_held(loan.slot)});
    idle_bytes_ += idle_.back().bytes;
  }

  std::uint32_t most_in_flight() const { return most_in_flight_; }
  std::uint64_t most_bytes() const { return most_bytes_; }

 private:
  void use(std::uint64_t bytes) {
    used_ += bytes;
    most_bytes_ = std::max(most_bytes_, used_ + idle_bytes_);
  }

  void make_room(std::uint64_t bytes) {
    for (Loan& slot : idle_) {  // the last slot is lent next, so it is emptied last
      if (used_ + idle_bytes_ + bytes <= budget_) return;
      if (slot.bytes == 0) continue;
      idle_bytes_ -= slot.bytes;
      scratch_.let_go(slot.slot);
      slot.bytes = 0;
    }
  }

  std::uint64_t budget_;
  Scratch scratch_;
  std::vector<Loan> idle_;  // each with its retained bytes
  std::uint32_t in_flight_ = 0, most_in_flight_ = 0;
  std::uint64_t used_ = 0;        // by layers in flight
  std::uint64_t idle_bytes_ = 0;  // of idle slots
  std::uint64_t most_bytes_ = 0;
};

}  // namespace lamina::pipeline
