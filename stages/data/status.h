// stages/data/status.h: expected failures are values that say where and what to do.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace lamina {

/// Whose fault a failure is; the value is the exit code of the command line.
enum class Fault : int {
  kInternal = 1,      // a bug of ours
  kUsage = 2,         // a wrong option or job
  kInput = 3,         // a part file that cannot be planned
  kOutput = 4,        // a result that could not be written
  kVerification = 5,  // outputs that are not what the manifest says, or engines that disagree
  kMemory = 6,        // the system gives no more memory, threads or open files
  kInterrupted = 130  // stopped by the user; finished layers are kept
};

/// One line for a person: the file, the place in it, what is wrong and what to do.
struct Error {
  Fault fault = Fault::kInternal;
  std::string message;
};

/// The answer to std::bad_alloc, with the address space that is needed at least (stages/data/shortage.h).
Error out_of_memory();

/// A value or the error that kept it from being made.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }

  /// The value. Only if ok().
  T& operator*() { return *std::get_if<0>(&state_); }
  const T& operator*() const { return *std::get_if<0>(&state_); }
  T* operator->() { return std::get_if<0>(&state_); }
  const T* operator->() const { return std::get_if<0>(&state_); }

  /// The error. Only if not ok().
  const Error& error() const { return *std::get_if<1>(&state_); }

 private:
  std::variant<T, Error> state_;
};

/// Success without a value, or an error.
template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)) {}

  bool ok() const { return !error_.has_value(); }
  explicit operator bool() const { return ok(); }
  const Error& error() const { return *error_; }

 private:
  std::optional<Error> error_;
};

using Status = Result<void>;

/// A problem with a result that was made nevertheless.
struct Warning {
  std::string code;  // short and stable, for scripts: "volume"
  std::string text;  // one line for a person
  // --- the place, where there is one
  std::string part = {};                    // its file
  std::optional<std::uint32_t> layer = {};  // the first
  std::optional<double> z_mm = {};          // of that layer's plane
};

/// What is wrong with many files.
struct Faults {
  std::uint64_t fault_count = 0;
  std::vector<std::string> faults;  // the first 20; each begins with a file's name
  bool ok() const { return fault_count == 0; }
  void add(std::string fault) {
    if (++fault_count <= 20) faults.push_back(std::move(fault));
  }
};

}  // namespace lamina
