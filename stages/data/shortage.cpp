#include "stages/data/shortage.h"

#include <atomic>
#include <new>
#include <string_view>
#include <system_error>

namespace lamina {
namespace {

std::atomic<std::uint64_t> refused{0};
std::new_handler handler_before = nullptr;

void count_refusal() {
  ++refused;
  if (handler_before == nullptr) throw std::bad_alloc();
  handler_before();
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

bool is_shortage(const std::exception& problem) {
  if (dynamic_cast<const std::bad_alloc*>(&problem) != nullptr) return true;
  if (const auto* of_system = dynamic_cast<const std::system_error*>(&problem)) {
    return of_system->code() == std::errc::resource_unavailable_try_again || of_system->code() == std::errc::not_enough_memory;
  }
  return std::string_view(problem.what()).starts_with("pthread_");  // oneTBB's, which is a std::runtime_error
}

}  // namespace lamina
