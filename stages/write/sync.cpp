#include "stages/write/sync.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>

#include "stages/write/file.h"

namespace lamina::write {
namespace {

/// The reason of a failed sync, 0 if the file system only cannot do it.
int failure() { return errno == EINVAL || errno == ENOTSUP || errno == ENOSYS || errno == EROFS || errno == EBADF ? 0 : errno; }

int open_folder(const std::string& folder) {
  return ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
}

int sync_and_close(int folder) {
  if (folder < 0) return 0;  // it may be written, but not be read
  const int reason = sync_file(folder);
  ::close(folder);
  return reason;
}

}  // namespace

int sync_file(int file) {
  while (::fsync(file) != 0) {
    if (errno != EINTR) return failure();
  }
  return 0;
}

int sync_folder(const std::string& folder) { return sync_and_close(open_folder(folder)); }

int sync_folder_of(const std::string& file) { return sync_folder(std::filesystem::path(file).parent_path().string()); }

struct FolderSync::Folders {
  struct Folder {
    std::string name;
    int file;
    dev_t device;
  };
  std::vector<Folder> all;
  ~Folders() {
    for (const Folder& folder : all) ::close(folder.file);
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

Status FolderSync::sync() const {
  for (const Folders::Folder& folder : folders_->all) {
    if (::syncfs(folder.file) == 0) continue;
    if (const int reason = failure(); reason != 0) return write_failure(folder.name, reason);
  }
  return {};
}

}  // namespace lamina::write
