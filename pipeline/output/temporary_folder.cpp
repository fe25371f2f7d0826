#include "pipeline/output/temporary_folder.h"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <string_view>
#include <utility>

namespace lamina::pipeline {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kDigits = "XXXXXX";

std::string lock_of(const std::string& folder) { return folder + "/.lamina-lock"; }

bool is_own(const fs::path& path, const std::string& stem) {
  const std::string name = path.filename().string();
  struct stat status {};
  return name.size() == stem.size() + kDigits.size() && name.starts_with(stem) && ::lstat(path.c_str(), &status) == 0 &&
         S_ISDIR(status.st_mode) && status.st_uid == ::geteuid();
}

/// Removes folders of killed runs: those without a locked file.
void remove_abandoned(const fs::path& position, const std::string& stem) {
  std::error_code error;
  for (fs::directory_iterator entry(position, error), end; !error && entry != end; entry.increment(error)) {
    const fs::path path = entry->path();
    std::error_code ignored;
    if (!is_own(path, stem)) continue;
    const int lock = ::open(lock_of(path.string()).c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC);
    if (lock < 0) {
      fs::remove(path, ignored);  // fails if it has files
    } else if (::flock(lock, LOCK_EX | LOCK_NB) == 0) {
      fs::remove_all(path, ignored);
    }
    if (lock >= 0) ::close(lock);
  }
}

}  // namespace

TemporaryFolder::TemporaryFolder(const std::string& purpose) {
  const std::string stem = "lamina_" + purpose + "_";
  std::error_code none;
  const fs::path position = fs::temp_directory_path(none);
  if (none) return;
  remove_abandoned(position, stem);
  for (int tries = 0; tries < 16; ++tries) {
    std::string name = (position / (stem + std::string(kDigits))).string();
    if (mkdtemp(name.data()) == nullptr) return;
    lock_ = ::open(lock_of(name).c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    // Another run may lock and remove it first. A file system without locks has nobody who removes it.
    const bool taken = lock_ < 0 || (::flock(lock_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK);
    if (!taken && ::access(lock_of(name).c_str(), F_OK) == 0) {
      path_ = name;
      return;
    }
    if (lock_ >= 0) ::close(std::exchange(lock_, -1));
    ::unlink(lock_of(name).c_str());
    ::rmdir(name.c_str());
  }
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
  if (lock_ >= 0) ::close(lock_);
}

Status TemporaryFolder::status() const {
  if (!path_.empty()) return {};
  return Error{Fault::kOutput, "no temporary folder can be made; TMPDIR names the folder that they are made in"};
}

std::string TemporaryFolder::file(const char* name) const { return (fs::path(path_) / name).string(); }

}  // namespace lamina::pipeline
