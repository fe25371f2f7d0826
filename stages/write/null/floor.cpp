#include "stages/write/null/floor.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "stages/data/handles/clocks.h"

namespace lamina::write {
namespace {

namespace fs = std::filesystem;

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

Status read_file(const std::string& path, std::vector<char>& block, std::uint64_t& bytes) {
  const Descriptor file(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) return system_error(Fault::kInput, path);
  for (;;) {
    const ssize_t got = read(file.get(), block.data(), block.size());
    if (got < 0) return system_error(Fault::kInput, path);
    if (got == 0) return {};
    bytes += static_cast<std::uint64_t>(got);
  }
}

Status write_file(const std::string& name, const std::vector<char>& block, std::uint64_t bytes) {
  const std::string unnamed = name + ".part";
  const Descriptor file(open(unnamed.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (file.get() < 0) return system_error(Fault::kOutput, unnamed);
  while (bytes > 0) {
    const ssize_t put = ::write(file.get(), block.data(), std::min<std::uint64_t>(bytes, block.size()));
    if (put <= 0) return system_error(Fault::kOutput, unnamed);
    bytes -= static_cast<std::uint64_t>(put);
  }
  return rename(unnamed.c_str(), name.c_str()) == 0 ? Status() : system_error(Fault::kOutput, name);
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

Result<double> read_all(const std::vector<std::string>& parts, std::vector<char>& block, std::uint64_t& bytes) {
  const Stopwatch reading;
  bytes = 0;
  for (const std::string& part : parts) {
    if (Status status = read_file(part, block, bytes); !status) return status.error();
  }
  return reading.elapsed().wall;
}

/// Files of equal size, into a new folder. It is removed afterwards, which no longer counts.
Result<double> write_all(const std::string& beside, const std::vector<char>& block, const Floor& floor) {
  const fs::path parent = fs::absolute(beside).parent_path();
  std::string folder = (parent / ".lamina-timing-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) return system_error(Fault::kOutput, folder);
  const Stopwatch writing;
  Status status;
  for (std::uint64_t i = 0; status && i < floor.files; ++i) {
    const std::uint64_t bytes = floor.bytes_written / floor.files + (i < floor.bytes_written % floor.files ? 1 : 0);
    status = write_file(fmt::format("{}/{}", folder, i), block, bytes);
  }
  const double seconds = writing.elapsed().wall;
  std::error_code ignored;
  fs::remove_all(folder, ignored);
  if (!status) return status.error();
  return seconds;
}

/// Reads one number a crossing and writes it, 64 MiB at a time. Both places have been written to before: fresh memory costs a
/// system several times as much, and a program may use what it has again. bench/limits.cpp does the same with real crossings.
double touch_all(std::uint64_t crossings) {
  const std::size_t block = std::min<std::uint64_t>(crossings, 1u << 24);
  std::vector<std::uint32_t> all(block, 1), copy(block, 2);
  std::uint32_t sum = 0;
  const Stopwatch touching;
  for (std::uint64_t done = 0; done < crossings; done += block) {
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

Status measure_floor(const std::vector<std::string>& parts, const std::string& output, Floor& floor) {
  std::vector<char> block(1 << 18, 'x');
  const Result<double> read = middle_seconds([&] { return read_all(parts, block, floor.bytes_read); });
  if (!read) return read.error();
  floor.read = *read;
  if (floor.files > 0) {
    const Result<double> written = middle_seconds([&] { return write_all(output, block, floor); });
    if (!written) return written.error();
    floor.write = *written;
  }
  floor.touch = touch_all(floor.crossings);
  return {};
}

}  // namespace lamina::write
