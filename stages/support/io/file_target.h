// stages/support/io/file_target.h: what a name leads to.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/status.h"

namespace lamina {

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

/// What tells files and directories apart, whatever their names.
struct FileId {
  std::uint64_t device = 0, inode = 0;
  friend bool operator==(const FileId&, const FileId&) = default;
};
/// Of what a name leads to; nothing if it is absent.
std::optional<FileId> file_id(const std::string& path);

/// Whether two names lead to the same file or directory, by device and inode; false if one of them is absent.
bool same_file(const std::string& a, const std::string& b);

/// Whether the name leads to a regular file.
bool is_file(const std::string& path);

/// Whether the name leads to a device, a pipe or a socket, or is "-", standard output.
bool is_stream(const std::string& path);

/// Whether the file is absent, empty, or contains one of `marks` in its first 4 KiB. A leading ^ requires the mark at the
/// start of the file; empty marks are ignored.
bool is_replaceable(const std::string& path, std::span<const std::string_view> marks);

// --- gives a finished file of a shard a second name.

/// A link in a shard's folder may lead anywhere; what it leads to is no file of the job.
/// bytes   that the manifest says, if it does
/// errors  kVerification: missing, no plain file, of another size
Status check_plain(const std::string& file, std::optional<std::uint64_t> bytes = {});

/// Links a file to another name, or copies it to another file system. The name appears once the file is whole; what had it is
/// replaced.
/// returns  whether it is a link
/// errors   kOutput
Result<bool> bring_file(const std::string& from, const std::string& to);

}  // namespace lamina
