// stages/support/clocks.h: seconds of processors and of the clock on the wall.
#pragma once

#include <chrono>
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

}  // namespace lamina
