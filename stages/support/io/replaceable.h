// stages/support/io/replaceable.h: examines the existing file under an output's name.
//
// Names are followed through links. cost  a system call or two; is_replaceable reads at most 4 KiB
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace lamina::write {

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

}  // namespace lamina::write
