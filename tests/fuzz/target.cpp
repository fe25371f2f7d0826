#include "tests/fuzz/target.h"

#include <fcntl.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>

namespace lamina::fuzz {
namespace {

void wanted(bool held, const char* what) {
  if (held) return;
  std::perror(what);
  std::abort();
}

/// Bytes that the process has read so far; 0 if the system does not say. A descriptor that stays open, for it is read twice a
/// run.
std::uint64_t bytes_read() {
  static const int counters = ::open("/proc/self/io", O_RDONLY | O_CLOEXEC);
  char text[64] = "";
  if (counters < 0 || ::pread(counters, text, sizeof text - 1, 0) < 8) return 0;
  return std::strtoull(text + 7, nullptr, 10);  // rchar: N
}

}  // namespace

bool run_target(const Target& target, std::string_view bytes) {
  const std::uint64_t before = bytes_read();
  const bool accepted = target.run(bytes);
  law(bytes_read() - before <= 8 * bytes.size() + (1 << 17), "more bytes are read than 8 times the input's and 128 KiB");
  return accepted;
}

std::vector<Target>& targets() {
  static std::vector<Target> all;
  return all;
}

Dice::Dice(std::string_view bytes) {
  for (const char c : bytes) state_ = (state_ ^ static_cast<unsigned char>(c)) * 1099511628211u;  // FNV-1a
}

std::uint64_t Dice::operator()() {  // SplitMix64 (Steele, Lea, Flood 2014)
  std::uint64_t z = state_ += 0x9e3779b97f4a7c15u;
  z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
  z = (z ^ z >> 27) * 0x94d049bb133111ebu;
  return z ^ z >> 31;
}

MemoryFile::MemoryFile(const std::string& name) {
  std::error_code absent;
  const bool shared = std::filesystem::is_directory("/dev/shm", absent);  // memory, on every Linux
  folder_ =
      ((shared ? "/dev/shm" : std::filesystem::temp_directory_path()) / std::filesystem::path("lamina_fuzz_XXXXXX")).string();
  wanted(::mkdtemp(folder_.data()) != nullptr, "mkdtemp");
  path_ = folder_ + "/" + name;
  file_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  wanted(file_ >= 0, "open");
}

MemoryFile::~MemoryFile() {
  ::close(file_);
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

const std::string& MemoryFile::hold(std::string_view bytes) {
  wanted(::ftruncate(file_, static_cast<off_t>(bytes.size())) == 0, "ftruncate");
  wanted(::pwrite(file_, bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size()), "pwrite");
  return path_;
}

void use_one_thread() { static const tbb::global_control kOne(tbb::global_control::max_allowed_parallelism, 1); }

}  // namespace lamina::fuzz
