// stages/write/replaceable.h: what stands under the name of a file that is to be written.
//
// Names are followed through links. cost  a system call or two; is_replaceable reads at most 4 KiB
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace lamina::write {

/// Whether two names lead to the same file or directory, by device and inode; false if one of them is absent.
bool same_file(const std::string& a, const std::string& b);

/// Whether a regular file is there.
bool is_file(const std::string& path);

/// Whether a device, a pipe or a socket is there, or the name is "-", standard output.
bool is_stream(const std::string& path);

/// Whether no file is there, an empty one, or one that holds one of `marks` in its first 4 KiB. A ^ before the first
/// character of a mark: the file begins with it; an empty mark is none.
bool is_replaceable(const std::string& path, std::span<const std::string_view> marks);

}  // namespace lamina::write
