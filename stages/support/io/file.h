// stages/support/io/file.h: the one way to write a file. It appears under its name only when it is whole.
//
// It grows under a temporary name next to it (temporary.h), is synced, takes its name, and its folder is synced: a power cut
// leaves the older file or this one. What the name leads to is decided once, when the file is opened: a link is followed,
// dangling or not; a directory, a device or a pipe is never replaced.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
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
  kBytes,  // the bytes; the caller syncs the folder
  kAll
};

struct FileOptions {
  bool stream = false;     // devices, pipes and sockets take the bytes as they come; "-" is standard output
  bool hash = false;       // finish() returns the XXH3-128 of all bytes
  bool keep_part = false;  // grows as NAME.part, which stays, however the run ends, until reopen(), open() or discard()
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
  /// Continues NAME.part of an earlier run, which is cut to `size` bytes; with `hash` these are read again.
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
  /// Replaces bytes that append() has taken, of a file without `hash` that is no stream.
  Status overwrite(std::uint64_t offset, std::span<const std::byte> bytes);
  /// What has been flushed survives a power cut, unless the file is a stream.
  Status sync();
  /// Gives an unfinished file, which grew under another name, the name NAME.part, locked and kept from now on; it takes
  /// the place of an older one at once.
  /// synced  its bytes are on the disk before; false: the caller sees to that, and nothing is lost until then
  Status become_part(bool synced = true);
  /// Flushes, syncs, closes and gives the file its name. returns  its size, and its hash if it was taken
  Result<FileDigest> finish();
  /// Removes what is not finished, kept or not.
  void discard();

  std::uint64_t size() const;  // bytes so far
  FileDigest digest() const;   // of the bytes so far
  bool streams() const;        // to a device, a pipe or standard output
  int descriptor() const;      // until finish()

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

// --- what a name leads to.

/// A file, there or not, or what takes bytes as they come.
struct FileTarget {
  std::string file;    // its name with all links followed; "" for a stream
  std::string stream;  // the name of a device, a pipe, a socket, or of an open descriptor
  int descriptor = -1;
};

/// /dev/stdout, /dev/fd/3 and "-" are open descriptors. Opens nothing.
/// follow  links, dangling or not; else a link is the file that is replaced
/// errors  kOutput: a directory, without `follow` a device or a pipe too, too many links, the system's reason
Result<FileTarget> find_target(const std::string& path, bool follow = true);

/// returns  a descriptor of a stream, to be closed. errors  kOutput: it is not allowed, or the system's reason
Result<int> open_stream(const std::string& path, const FileTarget& target, bool allowed);

// --- examines the existing file under an output's name.
//
// Names are followed through links. cost  a system call or two; is_replaceable reads at most 4 KiB

/// The identity of a file or directory, under any name.
struct FileId {
  std::uint64_t device = 0, inode = 0;
  friend bool operator==(const FileId&, const FileId&) = default;
};
/// Of what a name leads to; nothing if it is absent.
std::optional<FileId> file_id(const std::string& path);

/// The state of a regular file: a file with an equal stamp is unchanged, if the first stamp is settled.
struct FileStamp {
  FileId id;
  std::uint64_t bytes = 0;
  std::int64_t modified_ns = 0, changed_ns = 0;
  bool settled = false;  // the last change was longer ago than a step of the clock of files, so the next one has another time
  friend bool operator==(const FileStamp& a, const FileStamp& b) {
    return a.id == b.id && a.bytes == b.bytes && a.modified_ns == b.modified_ns && a.changed_ns == b.changed_ns;
  }
};
/// errors  nothing if the file is absent (errno), or not regular (errno is 0)
std::optional<FileStamp> file_stamp(const std::string& path);

/// Whether two names lead to the same file or directory, by device and inode; false if one of them is absent.
bool same_file(const std::string& a, const std::string& b);

/// Whether the name leads to a regular file, or through a container or the pages of a job to one of their files.
bool is_file(const std::string& path);

/// Whether the name leads to a device, a pipe or a socket, or is "-", standard output.
bool is_stream(const std::string& path);

/// Whether a file or directory can be made under a name, before the work for it. makes_folders  those above it too
/// errors  kOutput: no folder, no folder that may be written to
Status check_can_write(const std::string& path, bool makes_folders);

/// A name of at most `max_bytes` for files: a longer one is cut between characters of UTF-8 and ends in its hash.
std::string short_name(const std::string& name, std::size_t max_bytes);

/// Whether the file is absent, empty, or contains one of `marks` in its first 4 KiB. A leading ^ requires the mark at the
/// start of the file; empty marks are ignored.
bool is_replaceable(const std::string& path, std::span<const std::string_view> marks);

// --- gives a finished file of a shard a second name.

/// A link in a shard's folder may lead anywhere; what it leads to is no file of the job.
/// bytes   that the manifest says, if it does
/// errors  kVerification: missing, no plain file, of another size
Status check_plain(const std::string& file, std::optional<std::uint64_t> bytes = {});

/// Links a file to another name, or copies it to another file system or out of a container. The name appears once the file is
/// whole; what had it is replaced. returns  whether it is a link errors   kOutput
Result<bool> bring_file(const std::string& from, const std::string& to);

}  // namespace lamina
