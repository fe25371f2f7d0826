#include "stages/support/io/rename.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

namespace lamina {

int rename_in_one_step(const std::string& from, const std::string& to) {
  return ::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0 ? 0 : errno;
}

int rename_new(const std::string& from, const std::string& to) {
  const int reason = rename_in_one_step(from, to);
  return reason == EINVAL || reason == ENOSYS ? rename_new_by_link(from, to) : reason;
}

int rename_new_by_link(const std::string& from, const std::string& to) {
  int reason = ::linkat(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), 0) == 0 ? 0 : errno;
  struct stat status {
  }, linked{};
  // A server whose answer was lost gets the request again and finds the name that it has just made.
  if (reason == EEXIST && from != to && ::lstat(from.c_str(), &status) == 0 && ::lstat(to.c_str(), &linked) == 0 &&
      status.st_nlink == 2 && status.st_dev == linked.st_dev && status.st_ino == linked.st_ino)
    reason = 0;
  if (reason == 0) return ::unlink(from.c_str()) == 0 ? 0 : errno;
  if (reason == EEXIST || reason == ENOENT || reason == EXDEV) return reason;
  // Directories and file systems without links.
  if (::faccessat(AT_FDCWD, to.c_str(), F_OK, AT_SYMLINK_NOFOLLOW) == 0) return EEXIST;
  return std::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

}  // namespace lamina
