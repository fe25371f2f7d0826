#include "stages/formats/null/floor.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <span>

#include "stages/support/clocks.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"

namespace lamina::formats {
namespace {

/// A descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int file) : file_(file) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (file_ >= 0) close(file_);
  }
  int get() const { return file_; }

 private:
  int file_;
};

Error system_error(Fault fault, const std::string& path) { return {fault, path + ": " + std::strerror(errno)}; }
Error interrupted() { return {Fault::kInterrupted, "interrupted"}; }

Status read_file(const std::string& path, const std::atomic<bool>& cancel, std::vector<std::byte>& block,
                 std::uint64_t& bytes) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) return system_error(Fault::kInput, path);
  while (!cancel) {
    const ssize_t got = ::read(file.get(), block.data(), block.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return system_error(Fault::kInput, path);
    if (got == 0) return {};
    bytes += static_cast<std::uint64_t>(got);
  }
  return interrupted();
}

/// The names of two temporary files: of the one that grows, and of the last whole one. Both go at the end and at a
/// signal; what a killed run leaves goes with the next run that writes the same file.
class Names {
 public:
  explicit Names(const std::string& target) : growing(temporary_name(target)), whole(temporary_name(target)) {}
  Names(const Names&) = delete;
  Names& operator=(const Names&) = delete;
  ~Names() {
    for (const int which : watched_) forget(which);
    for (const std::string& name : {growing, whole}) remove_or_note(name);
  }

  const std::string growing, whole;

 private:
  int watched_[2] = {watch(growing.c_str()), watch(whole.c_str())};
};

Status write_file(const Names& names, const std::atomic<bool>& cancel, std::span<const std::byte> block, std::uint64_t bytes) {
  const Descriptor file(open(names.growing.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
  if (file.get() < 0) return system_error(Fault::kOutput, names.growing);
  while (bytes > 0) {
    if (cancel) return interrupted();
    const auto piece = block.first(std::min<std::uint64_t>(bytes, block.size()));
    if (const int reason = write_all(file.get(), piece); reason != 0) return write_failure(names.growing, reason);
    bytes -= piece.size();
  }
  const bool renamed = rename(names.growing.c_str(), names.whole.c_str()) == 0;
  return renamed ? Status() : system_error(Fault::kOutput, names.whole);
}

/// The middle of three, where one takes less than a tenth of a second; else the first. measure  its seconds, at each call
template <typename Measure>
Result<double> middle_seconds(Measure&& measure) {
  constexpr double kLong = 0.1;
  std::array<double, 3> seconds{};
  for (double& one : seconds) {
    const Result<double> measured = measure();
    if (!measured) return measured.error();
    one = *measured;
    if (one > kLong) return one;
  }
  std::sort(seconds.begin(), seconds.end());
  return seconds[1];
}

Result<double> read_files(const std::vector<std::string>& parts, const std::atomic<bool>& cancel, std::vector<std::byte>& block,
                          std::uint64_t& bytes) {
  const Stopwatch reading;
  bytes = 0;
  for (const std::string& part : parts) {
    if (Status status = read_file(part, cancel, block, bytes); !status) return status.error();
  }
  return reading.elapsed().wall;
}

/// Files of equal size, of which no more than two are there at a time. Removing them does not count.
Result<double> write_files(const Names& names, const std::atomic<bool>& cancel, std::span<const std::byte> block,
                           const Floor& floor) {
  double seconds = 0;
  for (std::uint64_t i = 0; i < floor.files; ++i) {
    const std::uint64_t bytes = floor.bytes_written / floor.files + (i < floor.bytes_written % floor.files ? 1 : 0);
    unlink(names.whole.c_str());  // where there is none yet, there is nothing to remove
    const Stopwatch writing;
    if (Status status = write_file(names, cancel, block, bytes); !status) return status.error();
    seconds += writing.elapsed().wall;
  }
  return seconds;
}

/// Reads one number a crossing and writes it, 64 MiB at a time. Both places have been written to before: fresh memory costs a
/// system several times as much, and a program may use what it has again.
Result<double> touch_all(std::uint64_t crossings, const std::atomic<bool>& cancel) {
  const std::size_t block = std::min<std::uint64_t>(crossings, 1u << 24);
  std::vector<std::uint32_t> all(block, 1), copy(block, 2);
  std::uint32_t sum = 0;
  const Stopwatch touching;
  for (std::uint64_t done = 0; done < crossings; done += block) {
    if (cancel) return interrupted();
    const std::size_t count = std::min<std::uint64_t>(block, crossings - done);
    for (std::size_t i = 0; i < count; ++i) {
      copy[i] = all[i];
      sum ^= all[i];
    }
    volatile std::uint32_t* const kept = copy.data();  // so that no compiler leaves out the copies
    sum ^= kept[count - 1];
  }
  volatile std::uint32_t keep = sum;
  static_cast<void>(keep);
  return touching.elapsed().wall;
}

}  // namespace

Status measure_floor(const std::vector<std::string>& parts, const std::string& neighbour, const std::atomic<bool>& cancel,
                     Floor& floor) {
  std::vector<std::byte> block(1 << 18, std::byte{'x'});
  const Result<double> read = middle_seconds([&] { return read_files(parts, cancel, block, floor.bytes_read); });
  if (!read) return read.error();
  floor.read = *read;
  if (floor.files > 0) {
    const Result<FileTarget> target = find_target(neighbour);
    if (!target) return target.error();
    if (target->file.empty()) return Error{Fault::kOutput, neighbour + ": is not a file; the limit is measured next to one"};
    const Names names(target->file);
    const Result<double> written = middle_seconds([&] { return write_files(names, cancel, block, floor); });
    if (!written) return written.error();
    floor.write = *written;
  }
  const Result<double> touched = touch_all(floor.crossings, cancel);
  if (!touched) return touched.error();
  floor.touch = *touched;
  return {};
}

}  // namespace lamina::formats
