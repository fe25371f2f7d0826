// stages/data/shortage.h: detects a shortage of memory or threads, also within libraries that do not report it.
#pragma once

#include <cstdint>
#include <exception>

namespace lamina {

/// How often `new` was refused memory in this process since the first call, which begins to count: a handler that counts and
/// then calls the previous one (std::set_new_handler). Callable from any thread.
std::uint64_t refused_allocations();

/// Whether an exception says that the system gives no more memory, or no more threads.
bool is_shortage(const std::exception& problem);

}  // namespace lamina
