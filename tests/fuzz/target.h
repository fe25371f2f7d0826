// tests/fuzz/target.h: a reader as a fuzz target: bytes in, laws over what is made of them. See tests/fuzz/README.md.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace lamina::fuzz {

/// A mutation of `size` bytes in place, at most `most` of them. returns the new size
using Mutate = std::size_t (*)(std::uint8_t* bytes, std::size_t size, std::size_t maximum, std::uint32_t seed);

struct Target {
  std::string_view name;                // of the reader, and of its folder in tests/corpus/fuzz
  bool (*run)(std::string_view bytes);  // reads, asserts laws; whether the reader accepted the bytes
  std::vector<std::string> (*seeds)();  // inputs that it accepts, at least one
  std::string_view sources;             // prefixes of paths, with blanks between: a change there requires a new campaign
  std::string_view files;               // endings of files that are good seeds, with blanks between
  std::string_view dictionary = {};     // in tests/fuzz/dictionaries
  std::size_t max_bytes = 4096;
  Mutate mutate = nullptr;
};

/// All targets of the program.
std::vector<Target>& targets();

/// Registers a target while the program starts.
struct Registered {
  explicit Registered(const Target& target) { targets().push_back(target); }
};

/// A reader gave back what it must not.
struct BrokenLaw : std::logic_error {
  using std::logic_error::logic_error;
};
inline void law(bool holds, const char* what) {
  if (!holds) throw BrokenLaw(what);
}

/// Runs a target under the law of work: of `size` bytes it reads at most 8 * size + 128 KiB from files, by the count of the
/// system. Not checked where the system does not count. throws  BrokenLaw
bool run_target(const Target& target, std::string_view bytes);

/// Choices that follow from the bytes, so that every file of the corpus means the same for ever.
class Dice {
 public:
  explicit Dice(std::string_view bytes);
  std::uint64_t operator()();
  /// 0 .. most - 1
  std::uint32_t below(std::uint32_t maximum) { return static_cast<std::uint32_t>((*this)() % maximum); }

 private:
  std::uint64_t state_ = 1469598103934665603u;
};

/// Bytes under a path, for readers that take one: a regular file in memory (tmpfs), so that no execution waits for a disk.
class MemoryFile {
 public:
  /// name  of the file, as "part.stl": readers use its extension
  explicit MemoryFile(const std::string& name);
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  ~MemoryFile();
  /// The path of a file with these bytes instead of the earlier ones.
  const std::string& hold(std::string_view bytes);

 private:
  std::string folder_, path_;
  int file_ = -1;
};

/// Lets work run on the calling thread alone, for the life of the process.
void use_one_thread();

}  // namespace lamina::fuzz
