// stages/support/io/file.h: the one way to write a file. It appears under its name only when it is whole.
//
// It grows under a temporary name beside it (temporary.h), is synced, takes its name, and its folder is synced: a power cut
// leaves the older file or this one. What the name leads to is decided once, when the file is opened: a link is followed,
// dangling or not; a directory, a device or a pipe is never replaced.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/support/hash/hash.h"

namespace lamina {

/// What of a file survives a power cut once finish() has returned.
enum class Durable {
  kNo,     // what the system has written by then
  kBytes,  // the bytes; whoever calls syncs the folder
  kAll
};

struct FileOptions {
  bool stream = false;     // devices, pipes and sockets take the bytes as they come; "-" is standard output
  bool hash = false;       // finish() returns the XXH3-128 of all bytes
  bool keep_part = false;  // grows as NAME.part, which stays, whatever ends the run, until reopen(), open() or discard()
  bool lock = true;        // off where a Claim holds the file or its directory: five system calls fewer
  bool follow = true;      // links; off for files of a job's directory, whose links are replaced
  bool replace = true;     // off: a file that is there in the end is an error
  Durable durable = Durable::kAll;
};

class File {
 public:
  /// Begins a file. What killed runs left of it is removed, with keep_part also NAME.part.
  /// errors  kOutput, one line with the path and the system's reason; another run writes the same file; the name is that
  ///         of a directory, or of a device or pipe without `stream`; NAME.part, if it is to be kept, is a link or no file
  static Result<File> open(const std::string& path, const FileOptions& options = {});
  /// Goes on with NAME.part of an earlier run, which is cut to `size` bytes; with `hash` these are read again.
  /// errors  those of open(); kOutput if NAME.part is absent or shorter
  static Result<File> reopen(const std::string& path, std::uint64_t size, const FileOptions& options = {});

  File(File&&) noexcept;
  File& operator=(File&&) noexcept;
  /// Removes what is not finished, unless its options keep it.
  ~File();

  /// errors  kOutput with the system's reason; small pieces are gathered, so that a later call may return the error
  Status append(std::span<const std::byte> bytes);
  Status append(std::string_view text) { return append(std::as_bytes(std::span(text))); }
  Status append(const Buffer<char>& text) { return append(std::as_bytes(std::span(text))); }
  /// Gives the system what append() has gathered; a killed run then leaves it in NAME.part.
  Status flush();
  /// What has been flushed survives a power cut, unless the file is a stream.
  Status sync();
  /// Gives an unfinished file, which grew under another name, the name NAME.part, locked and kept from now on; it takes
  /// the place of an older one at once.
  /// synced  its bytes are on the disk before; false: whoever calls sees to that, and nothing is lost until then
  Status become_part(bool synced = true);
  /// Flushes, syncs, closes and gives the file its name. returns  its size, and its hash if it was taken
  Result<FileDigest> finish();
  /// Removes what is not finished, kept or not.
  void discard();

  std::uint64_t size() const;  // bytes so far
  FileDigest digest() const;   // of the bytes so far
  bool streams() const;        // to a device, a pipe or standard output

 private:
  struct State;
  explicit File(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Writes a whole file. errors  those of File; an older file of that name stays as it was
Status write_file(const std::string& path, std::span<const std::byte> bytes, const FileOptions& options = {});
Status write_file(const std::string& path, std::string_view text, const FileOptions& options = {});

/// Writes all bytes to a descriptor, over interrupts and full pipes. returns  0 or the system's error number
int write_all(int file, std::span<const std::byte> bytes);

/// The one line about a file that could not be written, from the system's error number: what happened and what to do.
Error write_failure(const std::string& path, int code);

}  // namespace lamina
