#include "pipeline/output/program_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

namespace lamina::pipeline {

struct ProgramFile::State {
  int file = -1;
  std::string path;
  std::uint64_t bytes = 0;
  XXH3_state_t* hash = XXH3_createState();

  std::string partial() const { return path + ".part"; }
  Error failed(int reason) const { return {Fault::kOutput, fmt::format("{}: cannot write: {}", path, std::strerror(reason))}; }
  ~State() {
    XXH3_freeState(hash);
    if (file < 0) return;
    ::close(file);
    ::unlink(partial().c_str());
  }
};

ProgramFile::ProgramFile() : state_(std::make_unique<State>()) {}
ProgramFile::ProgramFile(ProgramFile&&) noexcept = default;
ProgramFile& ProgramFile::operator=(ProgramFile&&) noexcept = default;
ProgramFile::~ProgramFile() = default;

Result<ProgramFile> ProgramFile::create(const std::string& path) {
  ProgramFile made;
  State& state = *made.state_;
  state.path = path;
  state.file = ::open(state.partial().c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (state.file < 0) return state.failed(errno);
  XXH3_128bits_reset(state.hash);
  return made;
}

Status ProgramFile::append(std::span<const std::byte> bytes) {
  State& state = *state_;
  XXH3_128bits_update(state.hash, bytes.data(), bytes.size());
  state.bytes += bytes.size();
  while (!bytes.empty()) {
    const ssize_t written = ::write(state.file, bytes.data(), std::min<std::size_t>(bytes.size(), 1u << 30));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return state.failed(written < 0 ? errno : EIO);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return {};
}

Result<FileDigest> ProgramFile::finish() {
  State& state = *state_;
  const int file = std::exchange(state.file, -1);
  int reason = ::close(file) != 0 && errno != EINTR ? errno : 0;
  if (reason == 0 && std::rename(state.partial().c_str(), state.path.c_str()) != 0) reason = errno;
  if (reason != 0) {
    ::unlink(state.partial().c_str());
    return state.failed(reason);
  }
  const XXH128_hash_t hash = XXH3_128bits_digest(state.hash);
  return FileDigest{state.bytes, {hash.high64, hash.low64}};
}

}  // namespace lamina::pipeline
