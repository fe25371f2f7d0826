// stages/support/memory_gate.h: lets tasks begin while the memory that they need fits a budget.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace lamina {

/// Usable from many threads at once. A thread that has a pass must not enter again.
class MemoryGate {
 public:
  explicit MemoryGate(std::uint64_t bytes) : budget_(bytes) {}

  class Pass {
   public:
    Pass(MemoryGate& gate, std::uint64_t bytes) : gate_(gate), bytes_(bytes) {}
    Pass(const Pass&) = delete;
    Pass& operator=(const Pass&) = delete;
    ~Pass() { gate_.leave(bytes_); }

   private:
    MemoryGate& gate_;
    std::uint64_t bytes_;
  };

  /// Waits until so many bytes are free; a task that needs more than the budget runs alone.
  Pass enter(std::uint64_t bytes) {
    std::unique_lock lock(mutex_);
    left_.wait(lock, [&] { return used_ == 0 || used_ + bytes <= budget_; });
    used_ += bytes > 0 ? bytes : 1;
    return {*this, bytes > 0 ? bytes : 1};
  }

 private:
  void leave(std::uint64_t bytes) {
    {
      const std::scoped_lock lock(mutex_);
      used_ -= bytes;
    }
    left_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable left_;
  std::uint64_t budget_, used_ = 0;
};

}  // namespace lamina
