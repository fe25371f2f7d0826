// stages/support/io/sync.h: bytes and names that survive a power cut.
//
// Whatever a file system cannot sync (a folder, a file without a disk) is not an error; a failing disk is.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "stages/data/status.h"

namespace lamina {

/// Bytes and size of an open file. returns  0 or the system's error number
int sync_file(int file);

/// The names in a folder. returns  0 or the system's error number
int sync_folder(const std::string& folder);

/// The names in the folder of a file.
int sync_folder_of(const std::string& file);

/// Syncs what one run writes into some folders in one go.
///
/// The file systems of the folders are synced as a whole. 1,000 files of 8 kB take 0.01 s that way; synced one by one they
/// take 1.7 s, each waiting for the disk, and writing them out early as each is closed doubles the time of small files
/// (ext4 on a virtual disk). So a thread syncs what is there whenever some megabytes have come together: the disk works while
/// layers are made, and little is left for the end. The price: bytes of other programs that wait for the same disk go first, at
/// most those that the kernel lets wait. Files of an earlier run that this one keeps are included.
class FolderSync {
 public:
  /// Opens folders that exist, before anything is written: an error of the disk is told to whoever had it open (Linux 5.8).
  static FolderSync of(const std::vector<std::string>& folders);
  FolderSync(FolderSync&&) noexcept;
  FolderSync& operator=(FolderSync&&) noexcept;
  ~FolderSync();

  /// Begins the thread with what is there by now: a file that names the job reaches the disk while the first layers are made.
  /// errors  as wrote()
  Status begin() const;
  /// Tells how many bytes have been written since it was told before. May begin the thread.
  /// errors  of sync, as soon as the thread has met one
  Status wrote(std::uint64_t bytes) const;
  /// Ends the thread. errors  kOutput with the system's reason, also of what the thread met. cost  waits for the disk
  Status sync() const;

 private:
  FolderSync();
  struct Folders;
  std::unique_ptr<Folders> folders_;
};

}  // namespace lamina
