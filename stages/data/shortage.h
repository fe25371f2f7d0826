// stages/data/shortage.h: whether memory or threads ran out, within libraries that do not tell too.
#pragma once

#include <cstdint>
#include <exception>

namespace lamina {

/// How often `new` was refused memory in this process since the first call, which begins to count: a handler that counts and
/// goes on to the one before it (std::set_new_handler). Callable from any thread.
std::uint64_t refused_allocations();

/// Whether an exception says that the system gives no more memory, or no more threads.
bool is_shortage(const std::exception& problem);

}  // namespace lamina
