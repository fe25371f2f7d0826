// stages/support/clocks.h: seconds of processors and of the clock on the wall.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <ctime>

namespace lamina {

/// Of this thread, or of all threads of this process, since they began. cost  a system call
inline double processor_seconds(clockid_t of) {
  timespec time{};
  clock_gettime(of, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}
inline double thread_seconds() { return processor_seconds(CLOCK_THREAD_CPUTIME_ID); }
inline double process_seconds() { return processor_seconds(CLOCK_PROCESS_CPUTIME_ID); }

/// Wall and processor seconds between two moments.
struct Elapsed {
  double wall = 0, processor = 0;
};

/// Begins now.
class Stopwatch {
 public:
  Elapsed elapsed() const {
    return {std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(), process_seconds() - processor_};
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  double processor_ = process_seconds();
};

/// Adds up what calls take, from many threads at once.
class BusyClock {
 public:
  /// takes_processor_times  two calls of the system each
  explicit BusyClock(bool takes_processor_times) : takes_processor_times_(takes_processor_times) {}

  template <class Act>
  auto time(Act&& act) {
    struct Call {
      BusyClock& clock;
      std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
      double processor = clock.processor_seconds();
      ~Call() {
        const auto took = std::chrono::nanoseconds(std::chrono::steady_clock::now() - start).count();
        const double more = clock.processor_seconds() - processor;
        clock.wall_ns_.fetch_add(took, std::memory_order_relaxed);
        if (more > 0) clock.processor_ns_.fetch_add(static_cast<std::int64_t>(1e9 * more), std::memory_order_relaxed);
      }
    } const call{*this};
    return act();
  }

  Elapsed total() const { return {static_cast<double>(wall_ns_) * 1e-9, static_cast<double>(processor_ns_) * 1e-9}; }

 private:
  double processor_seconds() const { return takes_processor_times_ ? thread_seconds() : 0; }
  const bool takes_processor_times_;
  std::atomic<std::int64_t> wall_ns_{0}, processor_ns_{0};
};

}  // namespace lamina
