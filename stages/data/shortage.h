// stages/data/shortage.h: detects a shortage of memory, threads or open files, also within libraries that do not report it.
#pragma once

#include <cerrno>
#include <cstdint>
#include <exception>
#include <string>
#include <utility>

#include "stages/data/status.h"

namespace lamina {

/// How often `new` was refused memory in this process since the first call, which begins to count: a handler that counts and
/// then calls the previous one (std::set_new_handler). Callable from any thread.
std::uint64_t refused_allocations();

/// The address space in bytes that this process needs at least: the maximum it had, and the block that was refused last, but
/// more than its limit. 0: unknown. Allocates nothing.
std::uint64_t needed_address_space();

/// Checks that this much address space is free, where the system limits it. errors  kMemory
/// cost  a system call; three under a limit
Status check_address_space(std::uint64_t bytes);

/// Whether an exception says that the system gives no more memory, threads or open files.
bool is_shortage(const std::exception& problem);

/// The same of a reason in errno. Set errno to 0 before calls of libraries that report neither: malloc() leaves ENOMEM.
bool is_shortage(int reason);

/// kMemory with what is needed. path  of the file that was to be read or written, or ""
Error shortage(int reason, const std::string& path = {});
Error shortage(const std::exception& problem, const std::string& path = {});

/// The reason of the last shortage() of this process, 0: none since the last call. For what reports files as damaged.
int take_shortage();

/// The result of work that reads a file. A shortage is kMemory, whether the work throws it, or a library calls it damage.
template <class Work>
auto report_shortages(const std::string& path, const Work& work) -> decltype(work()) {
  errno = 0;
  try {
    auto result = work();
    if (!result && result.error().fault != Fault::kMemory && is_shortage(errno)) return shortage(errno, path);
    return result;
  } catch (const std::exception& problem) {
    if (!is_shortage(problem)) throw;
    return shortage(problem, path);
  }
}

/// The same error of an input: kInput, unless it is a shortage.
inline Error of_input(Error error) {
  return {error.fault == Fault::kMemory ? Fault::kMemory : Fault::kInput, std::move(error.message)};
}

}  // namespace lamina
