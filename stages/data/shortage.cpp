#include "stages/data/shortage.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string_view>
#include <system_error>

#include "stages/data/buffer.h"

namespace lamina {
namespace {

std::atomic<std::uint64_t> refused{0}, refused_block{0};
std::atomic<int> last_reason{0};
std::new_handler handler_before = nullptr;

void count_refusal() {
  ++refused;
  if (handler_before == nullptr) throw std::bad_alloc();
  handler_before();
}

std::uint64_t limit_of(__rlimit_resource resource) {
  rlimit limit{};
  return ::getrlimit(resource, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY ? limit.rlim_cur : 0;
}

/// The maximum address space that this process had; 0: unknown.
std::uint64_t max_address_space() {
  std::array<char, 4096> text{};
  const int file = ::open("/proc/self/status", O_RDONLY | O_CLOEXEC);
  if (file < 0) return 0;
  const ssize_t got = ::read(file, text.data(), text.size() - 1);
  ::close(file);
  const char* const peak = got > 0 ? std::strstr(text.data(), "VmPeak:") : nullptr;
  return peak != nullptr ? std::strtoull(peak + std::strlen("VmPeak:"), nullptr, 10) << 10 : 0;
}

int reason_of(const std::exception& problem) {
  const auto* of_system = dynamic_cast<const std::system_error*>(&problem);
  return of_system != nullptr ? of_system->code().value() : ENOMEM;
}

}  // namespace

std::uint64_t refused_allocations() {
  static const bool counting = [] {
    handler_before = std::get_new_handler();
    std::set_new_handler(count_refusal);
    return true;
  }();
  return counting ? refused.load() : 0;
}

void note_refused_block(std::uint64_t bytes) { refused_block = bytes; }

std::uint64_t needed_address_space() { return std::max(max_address_space() + refused_block.load(), limit_of(RLIMIT_AS)); }

Status check_address_space(std::uint64_t bytes) {
  if (limit_of(RLIMIT_AS) == 0) return {};
  void* const block = ::mmap(nullptr, bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (block != MAP_FAILED) return ::munmap(block, bytes), Status();
  note_refused_block(bytes);
  return shortage(ENOMEM);
}

bool is_shortage(int reason) { return reason == ENOMEM || reason == EMFILE || reason == ENFILE; }

bool is_shortage(const std::exception& problem) {
  if (dynamic_cast<const std::bad_alloc*>(&problem) != nullptr) return true;
  if (const auto* of_system = dynamic_cast<const std::system_error*>(&problem))
    return of_system->code() == std::errc::resource_unavailable_try_again || is_shortage(of_system->code().value());
  return std::string_view(problem.what()).starts_with("pthread_");  // oneTBB's, which is a std::runtime_error
}

Error out_of_memory() {
  last_reason = ENOMEM;
  const std::uint64_t needed = needed_address_space() >> 20;
  return {Fault::kMemory,
          fmt::format("out of memory{}; give a smaller --memory, fewer --threads or --jobs, or --engine contours, or run it "
                      "where more memory is free",
                      needed > 0 ? fmt::format(": needs more than {} MiB of address space", needed) : "")};
}

Error shortage(int reason, const std::string& path) {
  Error error = out_of_memory();
  last_reason = reason;
  if (reason == ENFILE) error.message = "too many open files in the system: needs one more; close other programs";
  if (reason == EMFILE)
    error.message =
        fmt::format("too many open files: needs more than {}; raise the limit (ulimit -n)", limit_of(RLIMIT_NOFILE));
  if (!path.empty()) error.message.insert(0, path + ": ");
  return error;
}

int take_shortage() { return last_reason.exchange(0); }

Error shortage(const std::exception& problem, const std::string& path) { return shortage(reason_of(problem), path); }

}  // namespace lamina
