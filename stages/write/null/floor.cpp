#include "stages/write/null/floor.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
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

Status read_all(const std::string& path, std::vector<char>& block, std::uint64_t& bytes) {
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

/// Files of equal size, into a new folder that is removed.
Status write_all(const std::string& beside, const std::vector<char>& block, const Floor& floor) {
  const fs::path parent = fs::absolute(beside).parent_path();
  std::string folder = (parent / ".lamina-timing-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) return system_error(Fault::kOutput, folder);
  Status status;
  for (std::uint64_t i = 0; status && i < floor.files; ++i) {
    const std::uint64_t bytes = floor.bytes_written / floor.files + (i < floor.bytes_written % floor.files ? 1 : 0);
    status = write_file(fmt::format("{}/{}", folder, i), block, bytes);
  }
  std::error_code ignored;
  fs::remove_all(folder, ignored);
  return status;
}

/// Writes one number a crossing and reads it back, 64 MiB at a time: in two passes, of which a compiler leaves out none.
void touch_all(std::uint64_t crossings) {
  std::vector<std::uint32_t> all(std::min<std::uint64_t>(crossings, 1u << 24));
  std::uint32_t sum = 0;
  for (std::uint64_t done = 0; done < crossings; done += all.size()) {
    const std::size_t count = std::min<std::uint64_t>(all.size(), crossings - done);
    for (std::size_t i = 0; i < count; ++i) all[i] = static_cast<std::uint32_t>(done + i);
    for (std::size_t i = 0; i < count; ++i) sum ^= all[i];
  }
  volatile std::uint32_t keep = sum;
  static_cast<void>(keep);
}

}  // namespace

Status measure_floor(const std::vector<std::string>& parts, const std::string& output, Floor& floor) {
  std::vector<char> block(1 << 18, 'x');
  const Stopwatch reading;
  for (const std::string& part : parts) {
    if (Status status = read_all(part, block, floor.bytes_read); !status) return status;
  }
  floor.read = reading.elapsed().wall;
  if (floor.files > 0) {
    const Stopwatch writing;
    if (Status status = write_all(output, block, floor); !status) return status;
    floor.write = writing.elapsed().wall;
  }
  const Stopwatch touching;
  touch_all(floor.crossings);
  floor.touch = touching.elapsed().wall;
  return {};
}

}  // namespace lamina::write
