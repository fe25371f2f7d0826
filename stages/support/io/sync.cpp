#include "stages/support/io/sync.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "stages/support/io/file.h"

namespace lamina {
namespace {

// Bytes that the thread waits for: few at first, so that a small job has less to wait for at its end, then twice as many.
constexpr std::uint64_t kFirst = 512 << 10, kMax = 4 << 20;

/// The reason of a failed sync, 0 if the file system only cannot do it.
int failure() { return errno == EINVAL || errno == ENOTSUP || errno == ENOSYS || errno == EROFS || errno == EBADF ? 0 : errno; }

int open_folder(const std::string& folder) {
  return ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
}

}  // namespace

int sync_file(int file) {
  while (::fsync(file) != 0) {
    if (errno != EINTR) return failure();
  }
  return 0;
}

int sync_folder(const std::string& folder) {
  const int file = open_folder(folder);
  if (file < 0) return 0;  // it may be written, but not be read
  const int reason = sync_file(file);
  ::close(file);
  return reason;
}

int sync_folder_of(const std::string& file) { return sync_folder(std::filesystem::path(file).parent_path().string()); }

struct FolderSync::Folders {
  struct Folder {
    std::string name;
    int file;
    dev_t device;
  };
  std::vector<Folder> all;
  std::thread early;
  std::mutex mutex;  // guards what follows
  std::condition_variable changed;
  std::uint64_t waiting = 0, enough = kFirst;  // bytes
  bool ends = false;
  Status met;  // the first failure

  ~Folders() {
    end_early();
    for (const Folder& folder : all) ::close(folder.file);
  }

  Status sync_all() const {
    for (const Folder& folder : all) {
      if (::syncfs(folder.file) == 0) continue;
      if (const int reason = failure(); reason != 0) return write_failure(folder.name, reason);
    }
    return {};
  }

  void sync_early() {
    std::unique_lock lock(mutex);
    for (;;) {
      changed.wait(lock, [this] { return ends || waiting >= enough; });
      if (ends || !met) return;
      waiting = 0;
      enough = std::min(2 * enough, kMax);
      lock.unlock();
      Status status = sync_all();
      lock.lock();
      met = std::move(status);
    }
  }

  void end_early() {
    if (!early.joinable()) return;
    {
      const std::lock_guard lock(mutex);
      ends = true;
    }
    changed.notify_one();
    early.join();
  }
};

FolderSync::FolderSync() : folders_(std::make_unique<Folders>()) {}
FolderSync::FolderSync(FolderSync&&) noexcept = default;
FolderSync& FolderSync::operator=(FolderSync&&) noexcept = default;
FolderSync::~FolderSync() = default;

FolderSync FolderSync::of(const std::vector<std::string>& folders) {
  FolderSync made;
  for (const std::string& name : folders) {
    const int file = open_folder(name);
    struct stat status {};
    const bool open = file >= 0 && ::fstat(file, &status) == 0;
    const bool known =
        std::ranges::find(made.folders_->all, status.st_dev, &Folders::Folder::device) != made.folders_->all.end();
    if (open && !known) {
      made.folders_->all.push_back({name, file, status.st_dev});
    } else if (file >= 0) {
      ::close(file);
    }
  }
  return made;
}

Status FolderSync::begin() const { return wrote(kFirst); }

Status FolderSync::wrote(std::uint64_t bytes) const {
  Folders& folders = *folders_;
  {
    const std::lock_guard lock(folders.mutex);
    folders.waiting += bytes;
    if (!folders.met || folders.waiting < folders.enough) return folders.met;
  }
  try {
    if (!folders.early.joinable()) folders.early = std::thread([&folders] { folders.sync_early(); });
  } catch (const std::system_error&) {
    return {};  // no room for a thread: all is left for the end
  }
  folders.changed.notify_one();
  return {};
}

Status FolderSync::sync() const {
  folders_->end_early();
  return folders_->met ? folders_->sync_all() : folders_->met;
}

}  // namespace lamina
